//! Proof that `canter-gait` runs without an operating system: this crate brings its own panic handler and no
//! allocator, so the build fails when `std` (a second panic handler) or `alloc` (no allocator) comes in anywhere below.

#![no_std]

extern crate canter_gait;

/// There is nowhere to report to: stop.
#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    loop {}
}

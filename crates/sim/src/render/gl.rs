//! An OpenGL context without a window, for MuJoCo's renderer: EGL, else OSMesa.
//!
//! Both libraries are loaded when a picture is asked for, so that building canter, and everything else that it does,
//! needs no OpenGL. Constants and signatures are those of the headers `EGL/egl.h`, `EGL/eglext.h` and `GL/osmesa.h`.

use std::ffi::{CStr, c_char, c_int, c_uint, c_void};
use std::mem::transmute;
use std::ptr;

use libloading::os::unix::{Library, RTLD_GLOBAL, RTLD_LAZY, RTLD_LOCAL};

use super::RenderError;

const EGL: &str = "libEGL.so.1";
/// The newest is first; each has the same interface.
const OSMESA: [&str; 2] = ["libOSMesa.so.8", "libOSMesa.so.6"];

/// What MuJoCo's own programs ask for.
const DEPTH_BITS: c_int = 24;

/// MuJoCo's own variable, which its Python package obeys too: `egl` or `osmesa` takes that one alone.
const CHOICE: &str = "MUJOCO_GL";

/// A context that is current on the thread that made it, until it is dropped there: raw handles keep it on the thread.
#[derive(Debug)]
pub enum GlContext {
    Egl(EglContext),
    OsMesa(OsMesaContext),
}

impl GlContext {
    /// Makes a context and makes it current on this thread.
    ///
    /// # Errors
    /// Neither library is there, or neither gives a context: says why, and what to install.
    pub fn new() -> Result<Self, RenderError> {
        let choice = std::env::var(CHOICE).unwrap_or_default();
        let mut reasons = Vec::new();
        if choice != "osmesa" {
            match EglContext::new() {
                Ok(context) => return Ok(Self::Egl(context)),
                Err(reason) => reasons.push(format!("EGL: {reason}")),
            }
        }
        if choice != "egl" {
            match OsMesaContext::new() {
                Ok(context) => return Ok(Self::OsMesa(context)),
                Err(reason) => reasons.push(format!("OSMesa: {reason}")),
            }
        }
        Err(RenderError::NoOpenGl(reasons))
    }

    /// Takes OpenGL's calls on this thread from now on: another context may have had them.
    ///
    /// # Panics
    /// The driver refuses, which it did not in [`new`](Self::new).
    pub fn make_current(&mut self) {
        let is_current = match self {
            Self::Egl(context) => context.egl.make_current(context.display, context.context),
            Self::OsMesa(context) => context.make_current(),
        };
        assert!(is_current, "OpenGL's driver refuses a context that it gave");
    }
}

type Handle = *mut c_void;

type AnyFunction = unsafe extern "C" fn();
type EglGetProcAddress = unsafe extern "C" fn(*const c_char) -> Option<AnyFunction>;
type EglInitialize = unsafe extern "C" fn(Handle, *mut c_int, *mut c_int) -> c_uint;
type EglBindApi = unsafe extern "C" fn(c_uint) -> c_uint;
type EglChooseConfig = unsafe extern "C" fn(Handle, *const c_int, *mut Handle, c_int, *mut c_int) -> c_uint;
type EglCreateContext = unsafe extern "C" fn(Handle, Handle, Handle, *const c_int) -> Handle;
type EglMakeCurrent = unsafe extern "C" fn(Handle, Handle, Handle, Handle) -> c_uint;
type EglDestroyContext = unsafe extern "C" fn(Handle, Handle) -> c_uint;
type EglQueryDevices = unsafe extern "C" fn(c_int, *mut Handle, *mut c_int) -> c_uint;
type EglGetPlatformDisplay = unsafe extern "C" fn(c_uint, Handle, *const c_int) -> Handle;

const EGL_OPENGL_API: c_uint = 0x30A2;
const EGL_PLATFORM_DEVICE_EXT: c_uint = 0x313F;
const EGL_PLATFORM_SURFACELESS_MESA: c_uint = 0x31DD;
const EGL_BLUE_SIZE: c_int = 0x3022;
const EGL_GREEN_SIZE: c_int = 0x3023;
const EGL_RED_SIZE: c_int = 0x3024;
const EGL_DEPTH_SIZE: c_int = 0x3025;
const EGL_SURFACE_TYPE: c_int = 0x3033;
const EGL_NONE: c_int = 0x3038;
const EGL_RENDERABLE_TYPE: c_int = 0x3040;
const EGL_PBUFFER_BIT: c_int = 1;
const EGL_OPENGL_BIT: c_int = 8;
/// Names and values of what a context has to give: colours, depth, no window, OpenGL.
#[rustfmt::skip]
const EGL_CONFIG: [c_int; 13] = [
    EGL_RED_SIZE, 8, EGL_GREEN_SIZE, 8, EGL_BLUE_SIZE, 8, EGL_DEPTH_SIZE, DEPTH_BITS,
    EGL_SURFACE_TYPE, EGL_PBUFFER_BIT, EGL_RENDERABLE_TYPE, EGL_OPENGL_BIT, EGL_NONE,
];
/// More graphics devices than a machine has.
const MAX_DEVICES: usize = 32;

/// A context on the first device that gives one. It has no surface: MuJoCo draws into buffers of its own.
#[derive(Debug)]
pub struct EglContext {
    egl: Egl,
    display: Handle,
    context: Handle,
}

/// The functions of the library that are used here.
#[derive(Debug)]
struct Egl {
    initialize: EglInitialize,
    bind_api: EglBindApi,
    choose_config: EglChooseConfig,
    create_context: EglCreateContext,
    make_current: EglMakeCurrent,
    destroy_context: EglDestroyContext,
    query_devices: EglQueryDevices,
    get_platform_display: EglGetPlatformDisplay,
}

impl Egl {
    fn load() -> Result<Self, String> {
        // Out of sight for now: MuJoCo takes its functions from EGL wherever it sees it, even if EGL gives no context
        // and OSMesa has to.
        let library = load(EGL, RTLD_LOCAL)?;
        // SAFETY: the types are those that EGL's headers give the functions of these names.
        unsafe {
            let get_proc_address: EglGetProcAddress = function(library, c"eglGetProcAddress")?;
            let extension = |name: &CStr| get_proc_address(name.as_ptr()).ok_or("it cannot do without a window");
            Ok(Self {
                initialize: function(library, c"eglInitialize")?,
                bind_api: function(library, c"eglBindAPI")?,
                choose_config: function(library, c"eglChooseConfig")?,
                create_context: function(library, c"eglCreateContext")?,
                make_current: function(library, c"eglMakeCurrent")?,
                destroy_context: function(library, c"eglDestroyContext")?,
                query_devices: transmute::<AnyFunction, EglQueryDevices>(extension(c"eglQueryDevicesEXT")?),
                get_platform_display: transmute::<AnyFunction, EglGetPlatformDisplay>(extension(
                    c"eglGetPlatformDisplayEXT",
                )?),
            })
        }
    }

    /// Displays without a window: one for each graphics device, Mesa's software among them, and Mesa's own choice.
    fn displays(&self) -> Vec<Handle> {
        let mut devices = [ptr::null_mut(); MAX_DEVICES];
        let mut count = 0;
        // SAFETY: the array has room for as many devices as the call is told.
        unsafe { (self.query_devices)(MAX_DEVICES as c_int, devices.as_mut_ptr(), &mut count) };
        let of_devices = devices.iter().take(count.max(0) as usize).map(|&device| (EGL_PLATFORM_DEVICE_EXT, device));
        of_devices
            .chain([(EGL_PLATFORM_SURFACELESS_MESA, ptr::null_mut())])
            // SAFETY: a device that EGL gave, or null for the default; no attributes.
            .map(|(platform, device)| unsafe { (self.get_platform_display)(platform, device, ptr::null()) })
            .filter(|display| !display.is_null())
            .collect()
    }

    /// A context on this display, current on this thread.
    fn make_context(&self, display: Handle) -> Option<Handle> {
        let (mut config, mut count) = (ptr::null_mut(), 0);
        // SAFETY: the display is one that EGL gave, the lists end with EGL_NONE or are absent, and there is room for the
        // one configuration that is asked for.
        unsafe {
            let is_ready = (self.initialize)(display, ptr::null_mut(), ptr::null_mut()) != 0
                && (self.bind_api)(EGL_OPENGL_API) != 0
                && (self.choose_config)(display, EGL_CONFIG.as_ptr(), &mut config, 1, &mut count) != 0
                && count == 1;
            if !is_ready {
                return None;
            }
            let context = (self.create_context)(display, config, ptr::null_mut(), ptr::null());
            if context.is_null() {
                return None;
            }
            if !self.make_current(display, context) {
                (self.destroy_context)(display, context);
                return None;
            }
            Some(context)
        }
    }

    fn make_current(&self, display: Handle, context: Handle) -> bool {
        // SAFETY: both are of EGL and alive, or the context is null: none.
        unsafe { (self.make_current)(display, ptr::null_mut(), ptr::null_mut(), context) != 0 }
    }
}

impl EglContext {
    fn new() -> Result<Self, String> {
        let egl = Egl::load()?;
        let on_display = |display| Some((display, egl.make_context(display)?));
        let (display, context) = egl.displays().into_iter().find_map(on_display).ok_or("no driver gives a context")?;
        // It works: now MuJoCo may see it.
        load(EGL, RTLD_GLOBAL)?;
        Ok(Self { egl, display, context })
    }
}

impl Drop for EglContext {
    fn drop(&mut self) {
        self.egl.make_current(self.display, ptr::null_mut());
        // SAFETY: display and context are those that `new` made, on this thread. The display is left as it is: another
        // context of this process may be on it.
        unsafe { (self.egl.destroy_context)(self.display, self.context) };
    }
}

type OsMesaCreateContext = unsafe extern "C" fn(c_uint, c_int, c_int, c_int, Handle) -> Handle;
type OsMesaMakeCurrent = unsafe extern "C" fn(Handle, *mut c_void, c_uint, c_int, c_int) -> u8;
type OsMesaDestroyContext = unsafe extern "C" fn(Handle);

const OSMESA_RGBA: c_uint = 0x1908;
const GL_UNSIGNED_BYTE: c_uint = 0x1401;
/// Side of the picture that OSMesa wants, in pixels. MuJoCo draws into buffers of its own.
const OSMESA_SIDE: usize = 16;

/// A context with the small picture that OSMesa cannot do without.
#[derive(Debug)]
pub struct OsMesaContext {
    make_current: OsMesaMakeCurrent,
    destroy_context: OsMesaDestroyContext,
    context: Handle,
    picture: Box<[[u8; 4]]>,
}

impl OsMesaContext {
    fn new() -> Result<Self, String> {
        let library = OSMESA.iter().find_map(|name| load(name, RTLD_GLOBAL).ok());
        let library = library.ok_or_else(|| format!("there is no {}", OSMESA[0]))?;
        // SAFETY: the types are those that OSMesa's header gives the functions of these names; no other context is shared.
        let mut made = unsafe {
            let create_context: OsMesaCreateContext = function(library, c"OSMesaCreateContextExt")?;
            Self {
                make_current: function(library, c"OSMesaMakeCurrent")?,
                destroy_context: function(library, c"OSMesaDestroyContext")?,
                context: create_context(OSMESA_RGBA, DEPTH_BITS, 0, 0, ptr::null_mut()),
                picture: vec![[0; 4]; OSMESA_SIDE * OSMESA_SIDE].into_boxed_slice(),
            }
        };
        if !made.context.is_null() && made.make_current() { Ok(made) } else { Err("it gives no context".to_owned()) }
    }

    fn make_current(&mut self) -> bool {
        let (picture, side) = (self.picture.as_mut_ptr().cast(), OSMESA_SIDE as c_int);
        // SAFETY: the context is alive, and the picture has four bytes for each pixel and lives as long.
        unsafe { (self.make_current)(self.context, picture, GL_UNSIGNED_BYTE, side, side) != 0 }
    }
}

impl Drop for OsMesaContext {
    fn drop(&mut self) {
        // SAFETY: the context is the one that `new` made, or null, which is none; its picture is freed after it.
        unsafe { (self.destroy_context)(self.context) };
    }
}

/// Loads a library for the rest of the process: MuJoCo keeps the addresses of its functions, and drivers do not bear to
/// be unloaded.
fn load(name: &str, flags: c_int) -> Result<&'static Library, String> {
    // SAFETY: the libraries that are named here are made to be loaded so; they are the system's.
    let library = unsafe { Library::open(Some(name), RTLD_LAZY | flags) };
    library.map(|library| &*Box::leak(Box::new(library))).map_err(|_| format!("there is no {name}"))
}

/// A function of a library that stays loaded.
///
/// # Safety
/// `F` must be the type of a function pointer, and of the function of this name.
unsafe fn function<F: Copy>(library: &'static Library, name: &CStr) -> Result<F, String> {
    // SAFETY: as the caller promises.
    let symbol = unsafe { library.get::<F>(name.to_bytes_with_nul()) };
    symbol.map(|symbol| *symbol).map_err(|_| format!("it has no {}", name.to_string_lossy()))
}

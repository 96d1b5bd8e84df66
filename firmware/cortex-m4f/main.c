/* Runs an exported policy on a Cortex-M4F (QEMU's mps2-an386) on recorded control steps.
 *
 * Semihosting is the only input and output: the host's file inputs.bin gives the control steps, as tests/export/run_onnx.py
 * describes them, outputs.bin gets what the chip makes of them, and the console what it cost.
 */
#include "canter_policy.h"

#include <stdint.h>
#include <string.h>

/* ---- Semihosting: ARM's way to the host of a debugger ---- */

enum { SYS_OPEN = 0x01, SYS_CLOSE = 0x02, SYS_WRITE0 = 0x04, SYS_WRITE = 0x05, SYS_READ = 0x06, SYS_EXIT = 0x18 };
enum { READ_BINARY = 1, WRITE_BINARY = 5 };
enum { EXIT_FINE = 0x20026, EXIT_ERROR = 0x20023 };

static uint32_t host(uint32_t operation, const void *argument)
{
    register uint32_t r0 __asm__("r0") = operation;
    register const void *r1 __asm__("r1") = argument;
    __asm__ volatile("bkpt 0xab" : "+r"(r0) : "r"(r1) : "memory");
    return r0;
}

static uint32_t open_file(const char *name, uint32_t mode)
{
    uint32_t block[3] = {(uint32_t)name, mode, strlen(name)};
    return host(SYS_OPEN, block);
}

/* Whether all was read. */
static int read_file(uint32_t file, void *target, uint32_t length)
{
    uint32_t block[3] = {file, (uint32_t)target, length};
    return host(SYS_READ, block) == 0;
}

static void write_file(uint32_t file, const void *source, uint32_t length)
{
    uint32_t block[3] = {file, (uint32_t)source, length};
    host(SYS_WRITE, block);
}

static void say(const char *name, uint32_t value)
{
    char text[48];
    char *end = text + sizeof text;
    *--end = 0;
    *--end = '\n';
    do {
        *--end = (char)('0' + value % 10);
        value /= 10;
    } while (value != 0);
    *--end = ' ';
    host(SYS_WRITE0, name);
    host(SYS_WRITE0, end);
}

static void leave(uint32_t reason)
{
    host(SYS_EXIT, (const void *)reason);
    for (;;) {
    }
}

/* ---- The processor ---- */

#define SYSTICK_CONTROL (*(volatile uint32_t *)0xe000e010)
#define SYSTICK_RELOAD (*(volatile uint32_t *)0xe000e014)
#define SYSTICK_VALUE (*(volatile uint32_t *)0xe000e018)
#define COPROCESSOR_ACCESS (*(volatile uint32_t *)0xe000ed88)

#define SYSTICK_MAX 0xffffffu

extern uint32_t stack_top, stack_bottom, data_start, data_end, data_load, bss_start, bss_end;

/* What the stack is filled with, to see how much of it was used. */
#define UNUSED 0xa5a5a5a5u

static uint32_t stack_used(void)
{
    uint32_t *place = &stack_bottom;
    while (*place == UNUSED) {
        place++;
    }
    return (uint32_t)((char *)&stack_top - (char *)place);
}

/* ---- The program ---- */

static canter_state state;
static canter_sensors sensors;
static float targets[CANTER_NUM_MOTORS];

/* The step's inputs and outputs as the files have them; not a part of what a robot needs. */
static float input[2 * CANTER_NUM_MOTORS + 7 + CANTER_NUM_ACTIONS];
static float output[CANTER_NUM_MOTORS + 1 + CANTER_NUM_ACTIONS];

/* Never a part of reset, which must not touch the floating-point unit before it is on. */
__attribute__((noinline)) static void run(void)
{
    uint32_t in = open_file("inputs.bin", READ_BINARY), out = open_file("outputs.bin", WRITE_BINARY);
    uint32_t steps = 0, most = 0, before, ticks;
    uint64_t all = 0;
    if (!(canter_self_test() <= CANTER_SELF_TEST_LIMIT)) {
        host(SYS_WRITE0, "self test failed\n");
        leave(EXIT_ERROR);
    }
    canter_init(&state);
    SYSTICK_RELOAD = SYSTICK_MAX;
    SYSTICK_VALUE = 0;
    /* On, with the processor's own clock. */
    SYSTICK_CONTROL = 5;
    while (read_file(in, input, sizeof input)) {
        const float *rest = input;
        memcpy(&sensors, rest, (2 * CANTER_NUM_MOTORS + 6) * sizeof(float));
        rest += 2 * CANTER_NUM_MOTORS + 6;
        sensors.age_s = 0.0f;
        /* Walking at full share: canter_step is then the control law and what surrounds it. */
        canter_walk(&state, 1);
        state.share = 1.0f;
        state.phase = *rest++;
        memcpy(state.action, rest, sizeof state.action);
        before = SYSTICK_VALUE;
        canter_step(&state, &sensors, CANTER_CONTROL_DT_S, targets);
        ticks = (before - SYSTICK_VALUE) & SYSTICK_MAX;
        all += ticks;
        most = ticks > most ? ticks : most;
        steps++;
        memcpy(output, targets, sizeof targets);
        output[CANTER_NUM_MOTORS] = state.phase;
        memcpy(output + CANTER_NUM_MOTORS + 1, state.action, sizeof state.action);
        write_file(out, output, sizeof output);
    }
    host(SYS_CLOSE, &out);
    say("steps", steps);
    say("ticks_mean", steps == 0 ? 0 : (uint32_t)(all / steps));
    say("ticks_most", most);
    say("stack_bytes", stack_used());
    say("state_bytes", sizeof state + sizeof sensors + sizeof targets);
    leave(EXIT_FINE);
}

void reset(void)
{
    uint32_t *from = &data_load, *to;
    /* Full access to the floating-point unit. */
    COPROCESSOR_ACCESS |= 0xfu << 20;
    __asm__ volatile("dsb\nisb");
    for (to = &data_start; to < &data_end;) {
        *to++ = *from++;
    }
    for (to = &bss_start; to < &bss_end;) {
        *to++ = 0;
    }
    for (to = &stack_bottom; to < (uint32_t *)__builtin_frame_address(0) - 16;) {
        *to++ = UNUSED;
    }
    run();
}

static void fault(void)
{
    host(SYS_WRITE0, "fault\n");
    leave(EXIT_ERROR);
}

__attribute__((section(".vectors"), used)) static const void *const vectors[16] = {
    &stack_top, (const void *)reset, (const void *)fault, (const void *)fault,
    (const void *)fault, (const void *)fault, (const void *)fault,
};

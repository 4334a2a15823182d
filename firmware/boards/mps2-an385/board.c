/* The board layer of ARM's MPS2 (AN385) as QEMU emulates it: UART0 to the host, a 25 MHz counter,
 * the watchdog; chips are simulated. */
#include "boards/mps2-an385/mps2.h"
#include "boards/simulated/world.h"

#define REGISTER(address) (*(volatile uint32_t *)(address))
#define UART_DATA REGISTER(0x40004000u)
#define UART_STATE REGISTER(0x40004004u)
#define UART_CONTROL REGISTER(0x40004008u)
#define UART_DIVIDER REGISTER(0x40004010u)
#define WATCHDOG_LOAD REGISTER(0x40008000u)
#define WATCHDOG_CONTROL REGISTER(0x40008008u)
#define WATCHDOG_LOCK REGISTER(0x40008C00u)
#define COUNTER REGISTER(0x40028018u)
#define PRESCALER REGISTER(0x4002801Cu)

#define SYSTICK_CONTROL REGISTER(0xE000E010u)
#define SYSTICK_RELOAD REGISTER(0xE000E014u)

enum { TX_FULL = 1, RX_FULL = 2, TICK_NS = 40, WATCHDOG_TICKS = 50000000 /* 2 s */ };

uint64_t mps2_bus_time;
bool mps2_is_counted;

uint32_t mps2_semihost(uint32_t operation, const void *argument)
{
    register uint32_t r0 __asm__("r0") = operation;
    register const void *r1 __asm__("r1") = argument;
    __asm__ volatile("bkpt 0xAB" : "+r"(r0) : "r"(r1) : "memory");
    return r0;
}

void mps2_start(void)
{
    PRESCALER = 0;
    SYSTICK_RELOAD = 12500; /* 0.5 ms */
    SYSTICK_CONTROL = mps2_is_counted ? 0 : 7;
    UART_DIVIDER = 16;
    UART_CONTROL = 3;
    WATCHDOG_LOCK = 0x1ACCE551u;
    WATCHDOG_LOAD = WATCHDOG_TICKS;
    WATCHDOG_CONTROL =
        mps2_is_counted ? 0 : 3; /* the first time-out interrupts, the second resets */
}

void mps2_sleep(void) { __asm__ volatile("wfi" ::: "memory"); }

uint64_t board_now(void)
{
    static uint32_t before;
    static uint64_t wraps;
    const uint32_t now = COUNTER;
    wraps += now < before ? 1u << 16 : 0;
    before = now;
    return ((wraps << 16) + now) * TICK_NS;
}

void board_wait(uint32_t microseconds)
{
    const uint64_t end = board_now() + (uint64_t)microseconds * 1000;
    while (board_now() < end) {
    }
}

bool board_transfer(const struct hs_bus *bus, const uint8_t *out, size_t n_out, uint8_t *in,
                    size_t n_in)
{
    const uint64_t before = mps2_is_counted ? board_now() : 0;
    const bool done = sim_transfer(bus, out, n_out, in, n_in);
    mps2_bus_time += mps2_is_counted ? board_now() - before : 0;
    return done;
}

size_t board_send(const uint8_t *bytes, size_t n)
{
    size_t sent = 0;
    if (mps2_is_counted) {
        return n;
    }
    while (sent < n && (UART_STATE & TX_FULL) == 0) {
        UART_DATA = bytes[sent++];
    }
    return sent;
}

size_t board_receive(uint8_t *bytes, size_t n)
{
    size_t got = 0;
    while (got < n && (UART_STATE & RX_FULL) != 0) {
        bytes[got++] = (uint8_t)UART_DATA;
    }
    return got;
}

bool board_flash_read(uint8_t page, uint8_t *bytes, size_t n)
{
    (void)page, (void)bytes, (void)n;
    return false;
}
bool board_flash_write(uint8_t page, const uint8_t *bytes, size_t n)
{
    (void)page, (void)bytes, (void)n;
    return false;
}
void board_feed_watchdog(void) { WATCHDOG_LOAD = WATCHDOG_TICKS; }
bool board_supply_is_low(void) { return false; }
uint8_t board_battery(void) { return 255; }
bool board_show_cue(const char *task)
{
    (void)task;
    return true;
}

/* The emulated board has no source of noise: the host's clock, in s, starts the sequence. */
uint32_t board_random(void)
{
    static uint32_t state;
    const uint32_t nothing[1] = {0};
    state = state != 0 ? state : mps2_semihost(0x11, nothing) * 2654435761u ^ COUNTER;
    state = state * 1664525u + 1013904223u;
    return state ^ state >> 16;
}

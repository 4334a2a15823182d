/* Vectors and the first instructions of a Cortex-M3. */
#include <stdint.h>
#include <string.h>

extern uint32_t data_start, data_end, data_source, bss_start, bss_end, stack_top;
int main(void);

void reset(void);

void reset(void)
{
    memcpy(&data_start, &data_source, (size_t)((uint8_t *)&data_end - (uint8_t *)&data_start));
    memset(&bss_start, 0, (size_t)((uint8_t *)&bss_end - (uint8_t *)&bss_start));
    main();
    for (;;) {
    }
}

/* A fault stays here until the watchdog begins the firmware anew. */
static void halt(void)
{
    for (;;) {
    }
}

/* The timer only wakes the processor. */
static void tick(void) {}

__attribute__((section(".vectors"), used)) static void *const vectors[16] = {
    &stack_top,
    (void *)reset,
    (void *)halt,
    (void *)halt,
    (void *)halt,
    (void *)halt,
    (void *)halt,
    0,
    0,
    0,
    0,
    (void *)halt,
    (void *)halt,
    0,
    (void *)halt,
    (void *)tick,
};

#ifndef HS_MPS2_H
#define HS_MPS2_H

#include <stdbool.h>
#include <stdint.h>

extern uint64_t mps2_bus_time; /* ns spent in transfers */
extern bool mps2_is_counted;   /* instructions are counted: no UART, no watchdog */

void mps2_start(void);
void mps2_sleep(void); /* until the next tick of 0.5 ms */
uint32_t mps2_semihost(uint32_t operation,
                       const void *argument); /* debugger's services, as QEMU gives them */

#endif

/* A board for tests: its clock is moved by hand, the host's side of the wire is a buffer, chips are
 * simulated. */
#ifndef HS_BENCH_H
#define HS_BENCH_H

#include "boards/simulated/world.h"

#include <stdio.h>
#include <stdlib.h>

#define BENCH_WIRE (1 << 22)

struct bench {
    uint64_t now;
    uint8_t to_host[BENCH_WIRE], to_glove[1 << 16];
    size_t sent, taken;   /* bytes of to_host that the glove sent */
    size_t written, read; /* bytes of to_glove, and of these read by the glove */
    size_t room;          /* bytes that the host still takes */
    uint32_t bus_ns;      /* a byte takes on the bus */
    bool supply_low;
    bool has_flash, flash_fails;
    uint8_t flash[2 * 64][HS_PAGE];
    int checks;
};

extern struct bench bench;
extern struct hs_glove bench_glove;

void bench_clear(void);
/* A glove of these strips, powered up, with all strips attached. */
void bench_power_up(const struct hs_layout *layout);
void bench_run(double seconds); /* in steps of 0.5 ms */
void bench_command(uint8_t type, const void *payload, size_t n);

/* Next frame that the glove sent since the last call, of any type or of one; false where there is
 * none. */
bool bench_next(struct hs_frame *frame);
bool bench_find(uint8_t type, struct hs_frame *frame);
void bench_forget(void); /* what was sent so far */

/* Code of the reply to a command, -1: none came. */
int bench_reply(uint8_t command);

#define CHECK(condition)                                                                           \
    do {                                                                                           \
        bench.checks++;                                                                            \
        if (!(condition)) {                                                                        \
            fprintf(stderr, "%s:%d: not so: %s\n", __FILE__, __LINE__, #condition);                \
            exit(1);                                                                               \
        }                                                                                          \
    } while (0)

#define PASSED() printf("%s: %d checks passed\n", __FILE__, bench.checks)

#endif

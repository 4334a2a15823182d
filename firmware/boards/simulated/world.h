/* Chips that are not there, register by register, on a hand that rests and then makes fists: what
 * drivers talk to without hardware. */
#ifndef HS_WORLD_H
#define HS_WORLD_H

#include "core/glove.h"

#define SIM_CHIPS (HS_SENSORS)
#define SIM_MEMORY 8192
#define SIM_FIFO 2048

struct sim_chip {
    struct hs_bus bus;
    const struct hs_driver *kind;
    uint8_t point;
    const float *mounting;
    bool broken;           /* does not answer */
    int32_t error_ppm;     /* of its oscillator */
    int16_t bias[HS_AXES]; /* counts */
    uint8_t bank, reg[2][128];
    uint64_t powered, next; /* base time of its power-up, of its next sample */
    int16_t newest[HS_AXES];
    uint8_t fifo[SIM_FIFO];
    uint32_t first, used; /* bytes of the FIFO */
    uint32_t samples;
    uint32_t lost; /* samples for which the FIFO had no room */
};

struct sim_eeprom {
    uint8_t bytes[SIM_MEMORY];
    uint64_t busy_until;
    bool present, latch;
};

struct sim_world {
    struct sim_chip chips[SIM_CHIPS];
    uint32_t count;
    struct sim_eeprom memory[HS_STRIPS];
    uint8_t slot[HS_STRIPS];
    bool plugged[HS_STRIPS];
    uint8_t strips;
    uint8_t hand;
    uint64_t moves_from; /* base time at which the hand's exercise begins; 0: it rests */
    int64_t
        supply; /* bytes that may still be written to memory until the power fails; -1: no end */
    uint32_t random;
};

extern struct sim_world sim;

/* Chips for every strip of the layout, all plugged in, with memory of their own. */
void sim_start(const struct hs_layout *layout, uint32_t seed, bool with_memory);
void sim_plug(uint8_t slot, bool plugged);
struct sim_chip *sim_chip_at(uint8_t slot, uint8_t select);

bool sim_transfer(const struct hs_bus *bus, const uint8_t *out, size_t n_out, uint8_t *in,
                  size_t n_in);

/* What the segment's own frame sees: rad/s, m/s^2 at a base time. */
void sim_motion(uint8_t point, uint64_t t, float *gyr, float *acc);

/* The exercise: rest for the initial pose, then fists at 0.5 Hz. */
#define SIM_POSE_AT (600 * HS_MILLISECOND)
#define SIM_POSE_LASTS (3400ull * HS_MILLISECOND)
#define SIM_TASK_AT (4500ull * HS_MILLISECOND)
#define SIM_TASK_LASTS (5300ull * HS_MILLISECOND)

/* Follow a glove: the exercise begins with its samples, and it marks pose and task. */
void sim_follow(struct hs_glove *glove);

/* End the samples after so many seconds of the glove's own time; 0: never. */
void sim_stop_after(struct hs_glove *glove, double seconds);

/* Within the simulation. */
bool sim_memory_transfer(struct sim_eeprom *memory, const uint8_t *out, size_t n_out, uint8_t *in,
                         size_t n_in);
void sim_chip_power(struct sim_chip *chip);
void sim_chip_transfer(struct sim_chip *chip, const uint8_t *out, size_t n_out, uint8_t *in,
                       size_t n_in);
uint32_t sim_draw(void);

/* True time between two samples of a chip, ns; 0: it is off. */
uint64_t sim_period(const struct sim_chip *chip);

#endif

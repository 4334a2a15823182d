/* A hand that lies flat, palm down, and then flexes all fingers and the thumb together;
 * accelerations other than gravity's are left out. */
#include "boards/simulated/world.h"

#include <math.h>

#define PI 3.14159265f
#define TABLE 1024

static float sine[TABLE + 1];

/* Sine of a phase in turns, from a table: a board without floating point has thousands to make each
 * second. */
static float sine_of(float turns)
{
    if (sine[TABLE / 4] == 0.0f) {
        for (int k = 0; k <= TABLE; k++) {
            sine[k] = sinf(2 * PI * (float)k / TABLE);
        }
    }
    const float at = (turns - floorf(turns)) * TABLE;
    const int k = (int)at;
    return sine[k] + (sine[k + 1] - sine[k]) * (at - (float)k);
}

/* Flexion of a segment against the hand at the closed fist, degrees: MCP 60, PIP 80, DIP 45; thumb
 * MCP 30, IP 40. */
static float closed(uint8_t point)
{
    static const float finger[3] = {60, 140, 185}, thumb[3] = {0, 30, 70};
    return point < HS_THUMB || point >= HS_TRUNK ? 0
           : point < HS_INDEX                    ? thumb[point - HS_THUMB]
                                                 : finger[(point - HS_INDEX) % 3];
}

void sim_motion(uint8_t point, uint64_t t, float *gyr, float *acc)
{
    const float rate = 0.5f, upward = sim.hand == HS_RIGHT ? -1.0f : 1.0f,
                widest = closed(point) / 360; /* turns */
    float angle = 0, speed = 0;
    if (sim.moves_from != 0 && t > sim.moves_from + SIM_TASK_AT) {
        const float phase = rate * (float)((t - sim.moves_from - SIM_TASK_AT) / 1000) * 1e-6f;
        angle = widest * (1 - sine_of(phase + 0.25f)) / 2;
        speed = widest * PI * rate * sine_of(phase); /* turns a second */
    }
    gyr[0] = gyr[1] = 0;
    gyr[2] = 2 * PI * speed;
    acc[0] = upward * HS_STANDARD_GRAVITY * sine_of(angle + 0.25f);
    acc[1] = -upward * HS_STANDARD_GRAVITY * sine_of(angle);
    acc[2] = 0;
}

void sim_follow(struct hs_glove *glove)
{
    static const char *const pose[] = {NULL};
    static const char *const task[] = {"task_name", "rom_fist", NULL};
    static uint8_t marked;
    const uint64_t now = board_now();
    if (!glove->running) {
        sim.moves_from = 0;
        marked = 0;
        return;
    }
    if (sim.moves_from == 0) {
        sim.moves_from = now;
        for (uint32_t k = 0; k < sim.count; k++) {
            sim.chips[k].lost = 0; /* what counts is lost while samples are sent */
        }
    }
    if (marked == 0 && now >= sim.moves_from + SIM_POSE_AT) {
        hs_glove_mark(glove, sim.moves_from + SIM_POSE_AT, SIM_POSE_LASTS, "initial_pose", pose);
        marked = 1;
    }
    if (marked == 1 && now >= sim.moves_from + SIM_TASK_AT) {
        hs_glove_mark(glove, sim.moves_from + SIM_TASK_AT, SIM_TASK_LASTS, "task", task);
        marked = 2;
    }
}

void sim_stop_after(struct hs_glove *glove, double seconds)
{
    if (glove->running && seconds > 0 && board_now() - glove->origin > (uint64_t)(seconds * 1e9)) {
        glove->running = false;
    }
}

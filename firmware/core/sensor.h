/* One sensor chip from power-up to resampled samples: reset, self-test, configuration, FIFO, its
 * clock. */
#ifndef HS_SENSOR_H
#define HS_SENSOR_H

#include "core/resampler.h"
#include "core/sensor_clock.h"
#include "sensors/driver.h"

enum hs_phase { HS_ABSENT, HS_RESET, HS_QUIET, HS_EXCITED, HS_SETTLING, HS_RUNNING };

struct hs_sensor {
    struct hs_bus bus;
    const struct hs_driver *driver;
    struct hs_setting setting;
    enum hs_phase phase;
    uint64_t due; /* when the phase is over, or when to look again */
    uint64_t next_sync;
    uint64_t last_reading; /* when readings last came */
    int32_t sum[HS_AXES], quiet[HS_AXES];
    uint8_t reads;
    bool tested, passed; /* self-test */
    uint8_t faults;      /* drains that failed, one after the other */
    uint32_t readings;   /* since it began to run */
    struct hs_partial partial;
    struct hs_sensor_clock clock;
    struct hs_resampler resampler;
};

/* Take the chip in operation if it answers; false where none is there. */
bool hs_sensor_begin(struct hs_sensor *sensor);

/* Go on with what is due; true while the sensor is on its way or running. */
bool hs_sensor_advance(struct hs_sensor *sensor);

/* New rate or range: configure it anew, without self-test. */
void hs_sensor_configure(struct hs_sensor *sensor);

/* What it measures really, Hz, by its own clock against the base unit's; nominal while that is not
 * known. */
float hs_sensor_true_rate(const struct hs_sensor *sensor);

#endif

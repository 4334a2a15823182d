/* A whole glove: strips that come and go, streams on one grid of time, commands in, frames out. One
 * instance, no heap. */
#ifndef HS_GLOVE_H
#define HS_GLOVE_H

#include "core/messages.h"
#include "core/outbox.h"
#include "core/sensor.h"
#include "core/strip_memory.h"

#define HS_FIRMWARE "handscope 1.0"

/* What may be plugged in at one connector. */
struct hs_strip_layout {
    uint8_t slot, count; /* sensors at select lines 0, 1, ... */
    uint8_t points[HS_PER_STRIP];
    const struct hs_driver *drivers[2]; /* inertial sensor, magnetometer; either may be NULL */
    uint8_t i2c_address[2];             /* of sensor 0, the next ones follow; 0: SPI */
    const float *mounting; /* q_BS (w, x, y, z) of its sensors, NULL: axes of the segments */
};

struct hs_layout {
    uint64_t device_id;
    uint8_t hand; /* enum hs_hand */
    const char *name;
    const struct hs_strip_layout *strips;
    uint8_t count;
    const struct hs_plate *plate; /* or NULL */
    double rate, mag_rate;        /* Hz; 0: 200 and 50 */
};

struct hs_stream {
    const struct hs_driver *driver; /* NULL: the strip has no such stream */
    struct hs_sensor *sensors;      /* the strip's count of them */
    double rate;                    /* Hz */
    float ranges[2];                /* SI, as asked for; 0: the chip's widest */
    struct hs_setting setting;
    uint8_t number, format;
    bool flowing;
    struct hs_grid next; /* first sample that was not sent */
};

enum hs_strip_state { HS_EMPTY, HS_STARTING, HS_ATTACHED };

struct hs_strip {
    const struct hs_strip_layout *layout;
    enum hs_strip_state state;
    bool was_attached;
    uint8_t count;
    uint64_t due;
    struct hs_stream streams[2];
    struct hs_strip_memory memory;
    struct hs_strip_record record;
};

struct hs_glove {
    const struct hs_layout *layout;
    struct hs_identity identity;
    struct hs_outbox outbox;
    struct hs_frame_reader inbox;
    struct hs_strip strips[HS_STRIPS];
    struct hs_sensor sensors[HS_SENSORS];
    uint8_t count; /* strips */
    bool running;
    bool supply_was_low;
    uint64_t origin; /* ns, of the grid: when samples were started */
    uint64_t announced;
};

/* Power-up: Identity is the first frame. NULL, or a sentence where the layout cannot be served. */
const char *hs_glove_start(struct hs_glove *glove, const struct hs_layout *layout);

/* Do what is due; call it as often as possible, every 2 ms at least. */
void hs_glove_poll(struct hs_glove *glove);

/* Something happened that the glove knows of, such as its button; pairs of key and value end with
 * NULL. */
void hs_glove_mark(struct hs_glove *glove, uint64_t t, uint64_t duration, const char *trial_type,
                   const char *const *pairs);

/* The host closed the port: samples stop, what waits is dropped. */
void hs_glove_hang_up(struct hs_glove *glove);

/* Within the core. */
void hs_strip_start(struct hs_glove *glove, struct hs_strip *strip);
void hs_strip_poll(struct hs_glove *glove, struct hs_strip *strip);
void hs_strip_describe(struct hs_glove *glove,
                       const struct hs_strip *strip); /* Strip and its calibrations */
void hs_strip_describe_streams(struct hs_glove *glove, const struct hs_strip *strip);
void hs_strip_send_calibrations(struct hs_glove *glove, const struct hs_strip *strip);
bool hs_stream_choose(
    struct hs_stream *stream); /* chip's rate and ranges from what is asked for; false: it cannot */
void hs_stream_configure(struct hs_stream *stream, uint8_t count);
void hs_stream_send(struct hs_glove *glove, struct hs_strip *strip, struct hs_stream *stream);
void hs_glove_execute(struct hs_glove *glove, const struct hs_frame *frame);
void hs_glove_describe(struct hs_glove *glove);

#endif

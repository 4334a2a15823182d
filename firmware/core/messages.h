/* Payloads of the wire protocol, version 1: docs/wire-protocol.md. */
#ifndef HS_MESSAGES_H
#define HS_MESSAGES_H

#include "core/bytes.h"
#include "core/frame_reader.h"
#include "core/limits.h"

#define HS_VERSION 1
#define HS_ALL_SLOTS 255
#define HS_MISSING (-32768) /* an int16 sample that was not measured */

enum hs_type {
    HS_IDENTITY = 0x01,
    HS_STRIP,
    HS_STREAM_INFO,
    HS_SAMPLES,
    HS_STATUS,
    HS_REPLY,
    HS_PONG,
    HS_CALIBRATION,
    HS_MARK,
    HS_PLATE,
    HS_IDENTIFY = 0x81,
    HS_CONFIGURE,
    HS_START,
    HS_STOP,
    HS_PING,
    HS_CUE,
    HS_READ_CALIBRATION,
    HS_WRITE_CALIBRATION
};

enum hs_reply_code { HS_DONE, HS_UNKNOWN_COMMAND, HS_BAD_ARGUMENT, HS_BUSY };
enum hs_hand { HS_HAND_UNKNOWN, HS_LEFT, HS_RIGHT };
enum hs_quantity { HS_GYR = 1, HS_ACC = 2, HS_MAG = 4 };
enum hs_format { HS_INT16, HS_FLOAT32 };

/* Points, where a sensor sits; the three of a finger follow each other. */
enum hs_point {
    HS_FOREARM,
    HS_ON_HAND,
    HS_THUMB = 2,
    HS_INDEX = 5,
    HS_MIDDLE = 8,
    HS_RING_FINGER = 11,
    HS_LITTLE = 14,
    HS_TRUNK = 17,
    HS_TRUNK_MAG = 23,
    HS_LAST_POINT = 54
};

struct hs_identity {
    uint64_t device_id;
    uint32_t boot_id;
    uint8_t hand;
    const char *name, *firmware;
};

struct hs_stream_info {
    uint8_t stream, slot, clock, quantities, format;
    double rate; /* Hz */
    float scale[3],
        full_scale[3]; /* SI units per count, SI units; by quantity, in the order of their bits */
};

struct hs_burst { /* head of Samples; the values follow */
    uint8_t stream;
    uint32_t index;
    uint64_t t_first, t_sent; /* ns */
    uint8_t count;
};

struct hs_calibration { /* y = M (x - bias) of gyr, acc, mag; M row by row */
    float bias[9], matrix[27];
};

struct hs_plate {                          /* magnetometers on the trunk, magnet on the hand */
    float earth, dip, moment[3], place[3]; /* T, rad, A m^2, m */
    uint8_t n;
    const uint8_t *points;
    const float (*places)[3]; /* m */
};

struct hs_configure {
    uint8_t slot;
    double rate, mag_rate;      /* Hz; 0 keeps what is set */
    float gyr_range, acc_range; /* rad/s, m/s^2; 0 keeps what is set */
    uint8_t format;
};

struct hs_command {
    uint8_t type;
    union {
        struct hs_configure configure;
        uint64_t token;
        char task[HS_TEXT];
        uint8_t slot;
        struct {
            uint8_t slot, sensor;
            struct hs_calibration calibration;
        } write;
    } of;
};

/* HS_DONE; HS_BAD_ARGUMENT where the bytes do not make that command; HS_UNKNOWN_COMMAND. */
enum hs_reply_code hs_read_command(const struct hs_frame *frame, struct hs_command *command);

uint8_t hs_quantities_of(uint8_t mask); /* how many bits are set */

void hs_write_identity(struct hs_writer *w, const struct hs_identity *m);
void hs_write_strip(
    struct hs_writer *w, uint8_t slot, bool attached, uint64_t strip_id, uint8_t n,
    const uint8_t *points,
    const float *mounting); /* mounting: w, x, y, z of all its sensors alike, or NULL */
void hs_write_stream_info(struct hs_writer *w, const struct hs_stream_info *m);
void hs_write_burst(struct hs_writer *w, const struct hs_burst *m);
void hs_write_status(struct hs_writer *w, uint64_t t, uint32_t overruns, uint8_t battery,
                     float celsius);
void hs_write_reply(struct hs_writer *w, uint8_t command, enum hs_reply_code code,
                    const char *text);
void hs_write_pong(struct hs_writer *w, uint64_t token, uint64_t t);
void hs_write_calibration(struct hs_writer *w, uint8_t slot, uint8_t sensor,
                          const struct hs_calibration *m);
void hs_write_mark(struct hs_writer *w, uint64_t t, uint64_t duration, const char *trial_type,
                   const char *const *pairs);
void hs_write_plate(struct hs_writer *w, const struct hs_plate *m);

/* The numbers of a calibration as they stand on the wire and in a strip's memory. */
void hs_put_calibration(struct hs_writer *w, const struct hs_calibration *m);
void hs_get_calibration(struct hs_reader *r, struct hs_calibration *m);
void hs_identity_calibration(struct hs_calibration *m);
bool hs_is_finite(const struct hs_calibration *m);

#endif

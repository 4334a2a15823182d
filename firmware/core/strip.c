/* A connector: empty, with a strip whose sensors start, or with one that is attached. */
#include "core/glove.h"

#define SWEEP (5 * HS_MILLISECOND)
#define LOOK                                                                                       \
    (20 * HS_MILLISECOND) /* at an empty connector; its sensors pause longer by themselves */

static void set_up_stream(struct hs_glove *glove, struct hs_strip *strip, int which,
                          struct hs_sensor *sensors)
{
    struct hs_stream *stream = &strip->streams[which];
    const bool inertial = which == 0;
    const double asked = inertial ? glove->layout->rate : glove->layout->mag_rate;
    stream->driver = strip->layout->drivers[which];
    stream->sensors = sensors;
    stream->number = (uint8_t)(2 * strip->layout->slot + which);
    stream->rate = asked > 0 ? asked : inertial ? 200 : 50;
    if (stream->driver == NULL) {
        return;
    }
    for (uint8_t k = 0; k < strip->layout->count; k++) {
        const uint8_t first = strip->layout->i2c_address[which];
        sensors[k].bus = (struct hs_bus){
            strip->layout->slot,
            (uint8_t)(k + (inertial || strip->layout->drivers[0] == NULL ? 0 : HS_PER_STRIP)),
            (uint8_t)(first == 0 ? 0 : first + k)};
        sensors[k].driver = stream->driver;
    }
}

void hs_strip_start(struct hs_glove *glove, struct hs_strip *strip)
{
    struct hs_sensor *next = glove->sensors;
    for (const struct hs_strip *before = glove->strips; before < strip; before++) {
        for (int which = 0; which < 2; which++) {
            next += before->streams[which].driver != NULL ? before->layout->count : 0;
        }
    }
    strip->count = strip->layout->count;
    set_up_stream(glove, strip, 0, next);
    next += strip->streams[0].driver != NULL ? strip->layout->count : 0;
    set_up_stream(glove, strip, 1, next);
    for (int which = 0; which < 2; which++) {
        struct hs_stream *stream = &strip->streams[which];
        if (stream->driver != NULL && hs_stream_choose(stream)) {
            for (uint8_t k = 0; k < strip->count; k++) {
                stream->sensors[k].setting = stream->setting;
            }
        }
    }
    strip->due = board_now() +
                 (uint64_t)strip->layout->slot * (SWEEP / HS_STRIPS); /* connectors take turns */
}

/* Advance all sensors; how many are running, and how many are on their way there. */
static int advance(struct hs_strip *strip, int *starting)
{
    int running = 0;
    *starting = 0;
    for (int which = 0; which < 2; which++) {
        for (uint8_t k = 0; strip->streams[which].driver != NULL && k < strip->count; k++) {
            struct hs_sensor *sensor = &strip->streams[which].sensors[k];
            hs_sensor_advance(sensor);
            running += sensor->phase == HS_RUNNING ? 1 : 0;
            *starting += sensor->phase != HS_RUNNING && sensor->phase != HS_ABSENT ? 1 : 0;
        }
    }
    return running;
}

static void use_record(struct hs_strip *strip, bool known)
{
    struct hs_strip_record *record = &strip->record;
    if (known && record->n > 0 && record->n <= strip->layout->count) {
        strip->count = record->n;
        return;
    }
    *record = (struct hs_strip_record){.n = strip->layout->count};
    while (record->strip_id == 0) {
        record->strip_id = (uint64_t)board_random() << 32 | board_random();
    }
    memcpy(record->points, strip->layout->points, sizeof record->points);
    for (uint8_t k = 0; k < record->n; k++) {
        hs_identity_calibration(&record->calibration[k]);
    }
    hs_strip_memory_write(
        &strip->memory,
        record); /* where it cannot be kept the strip has another number at the next power-up */
}

/* A sensor whose self-test failed is sent all the same; the recording says so. */
static void report_self_tests(struct hs_glove *glove, const struct hs_strip *strip)
{
    for (uint8_t k = 0; strip->streams[0].driver != NULL && k < strip->count; k++) {
        const struct hs_sensor *sensor = &strip->streams[0].sensors[k];
        if (sensor->tested && !sensor->passed) {
            const char slot[2] = {(char)('0' + strip->layout->slot % 10), 0},
                       number[2] = {(char)('0' + k), 0};
            const char *const pairs[] = {
                "slot", slot, "sensor", number, "chip", sensor->driver->name, NULL};
            hs_glove_mark(glove, board_now(), 0, "self_test_failed", pairs);
        }
    }
}

static void attach(struct hs_glove *glove, struct hs_strip *strip)
{
    strip->count = strip->layout->count;
    use_record(strip, hs_strip_memory_open(&strip->memory, strip->layout->slot, &strip->record));
    strip->state = HS_ATTACHED;
    strip->was_attached = true;
    hs_strip_describe(glove, strip);
    hs_strip_describe_streams(glove, strip);
    report_self_tests(glove, strip);
}

static void detach(struct hs_glove *glove, struct hs_strip *strip)
{
    strip->state = HS_EMPTY;
    strip->streams[0].flowing = strip->streams[1].flowing = false;
    hs_strip_describe(glove, strip);
    strip->count = strip->layout->count;
    for (uint8_t k = 0; strip->streams[0].driver != NULL && k < strip->count; k++) {
        strip->streams[0].sensors[k].tested = false; /* what comes next may be another strip */
    }
}

void hs_strip_poll(struct hs_glove *glove, struct hs_strip *strip)
{
    int starting = 0;
    const uint64_t now = board_now();
    if (now < strip->due) {
        return;
    }
    strip->due = strip->due + SWEEP > now ? strip->due + SWEEP : now + SWEEP;
    const int running = advance(strip, &starting);
    if (running + starting == 0) {
        if (strip->state == HS_ATTACHED) {
            detach(glove, strip);
        }
        strip->state = HS_EMPTY;
        strip->due = now + LOOK;
    } else if (strip->state == HS_EMPTY) {
        strip->state = HS_STARTING;
    } else if (strip->state == HS_STARTING && starting == 0) {
        attach(glove, strip);
    }
    for (int which = 0; strip->state == HS_ATTACHED && which < 2; which++) {
        if (strip->streams[which].driver != NULL) {
            hs_stream_send(glove, strip, &strip->streams[which]);
        }
    }
}

void hs_strip_send_calibrations(struct hs_glove *glove, const struct hs_strip *strip)
{
    for (uint8_t k = 0; k < strip->count; k++) {
        hs_write_calibration(hs_outbox_begin(&glove->outbox, HS_CALIBRATION), strip->layout->slot,
                             k, &strip->record.calibration[k]);
        hs_outbox_end(&glove->outbox);
    }
}

void hs_strip_describe(struct hs_glove *glove, const struct hs_strip *strip)
{
    if (!strip->was_attached) {
        return;
    }
    const bool attached = strip->state == HS_ATTACHED;
    hs_write_strip(hs_outbox_begin(&glove->outbox, HS_STRIP), strip->layout->slot, attached,
                   strip->record.strip_id, strip->count, strip->record.points,
                   strip->layout->mounting);
    hs_outbox_end(&glove->outbox);
    if (attached) {
        hs_strip_send_calibrations(glove, strip);
    }
}

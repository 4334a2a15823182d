/* What the host asks for, and the answers. */
#include "core/glove.h"

#define FASTEST 1000.0    /* Hz */
#define FASTEST_MAG 100.0 /* Hz */
#define SLOWEST 1.0       /* Hz: a period of the grid fits 32 bits of ns */

static void reply(struct hs_glove *glove, uint8_t command, enum hs_reply_code code,
                  const char *text)
{
    hs_write_reply(hs_outbox_begin(&glove->outbox, HS_REPLY), command, code, text);
    hs_outbox_end(&glove->outbox);
}

static struct hs_strip *strip_at(struct hs_glove *glove, uint8_t slot)
{
    for (uint8_t k = 0; k < glove->count; k++) {
        if (glove->strips[k].layout->slot == slot) {
            return &glove->strips[k];
        }
    }
    return NULL;
}

static bool is_rate(double rate, double fastest)
{
    return rate == 0 || (rate >= SLOWEST && rate <= fastest);
}

/* The stream as it would be; false where the chip cannot. */
static bool adapted(const struct hs_stream *stream, const struct hs_configure *c, bool inertial,
                    struct hs_stream *made)
{
    *made = *stream;
    made->format = c->format;
    const double rate = inertial ? c->rate : c->mag_rate;
    made->rate = rate > 0 ? rate : stream->rate;
    if (inertial) {
        made->ranges[0] = c->gyr_range > 0 ? c->gyr_range : stream->ranges[0];
        made->ranges[1] = c->acc_range > 0 ? c->acc_range : stream->ranges[1];
    }
    return hs_stream_choose(made);
}

/* Look at all that is meant (apply: do it); false where one cannot. */
static bool configure_all(struct hs_glove *glove, const struct hs_configure *c, bool apply)
{
    for (uint8_t k = 0; k < glove->count; k++) {
        struct hs_strip *strip = &glove->strips[k];
        for (int which = 0;
             which < 2 && (c->slot == HS_ALL_SLOTS || c->slot == strip->layout->slot); which++) {
            struct hs_stream made;
            if (strip->streams[which].driver == NULL) {
                continue;
            }
            if (!adapted(&strip->streams[which], c, which == 0, &made)) {
                return false;
            }
            if (apply) {
                strip->streams[which] = made;
                hs_stream_configure(&strip->streams[which], strip->layout->count);
            }
        }
    }
    return true;
}

static const char *configure(struct hs_glove *glove, const struct hs_configure *c)
{
    if (c->slot != HS_ALL_SLOTS && strip_at(glove, c->slot) == NULL) {
        return "this glove has no such slot";
    }
    if (!is_rate(c->rate, FASTEST) || !is_rate(c->mag_rate, FASTEST_MAG)) {
        return "rates go from 1 to 1000 Hz, of magnetometers to 100 Hz; 0 keeps what is set";
    }
    if (c->format > HS_FLOAT32 || !(c->gyr_range >= 0) || !(c->acc_range >= 0)) {
        return "format is 0 or 1, ranges are positive";
    }
    if (!configure_all(glove, c, false)) {
        return "the sensors have no such range";
    }
    configure_all(glove, c, true);
    for (uint8_t k = 0; k < glove->count; k++) {
        hs_strip_describe_streams(glove, &glove->strips[k]);
    }
    return NULL;
}

static const char *write_calibration(struct hs_glove *glove, const struct hs_command *command)
{
    static struct hs_strip_record record;
    const uint8_t sensor = command->of.write.sensor;
    struct hs_strip *strip = strip_at(glove, command->of.write.slot);
    if (strip == NULL || strip->state != HS_ATTACHED || sensor >= strip->count) {
        return "there is no such sensor";
    }
    if (!hs_is_finite(&command->of.write.calibration)) {
        return "a calibration of numbers that are not finite";
    }
    record = strip->record;
    record.calibration[sensor] = command->of.write.calibration;
    if (strip->memory.kind == HS_NO_MEMORY) {
        return "this strip has no memory";
    }
    if (!hs_strip_memory_write(&strip->memory, &record)) {
        return "the strip's memory did not keep it; what it had before still holds";
    }
    strip->record = record;
    hs_strip_send_calibrations(glove, strip);
    return NULL;
}

static const char *read_calibration(struct hs_glove *glove, uint8_t slot)
{
    const struct hs_strip *strip = strip_at(glove, slot);
    if (strip == NULL || strip->state != HS_ATTACHED) {
        return "no strip is plugged in there";
    }
    hs_strip_send_calibrations(glove, strip);
    return NULL;
}

static void start(struct hs_glove *glove)
{
    if (!glove->running) {
        glove->running = true;
        glove->origin = board_now();
        glove->announced = board_now();
    }
    hs_glove_describe(glove);
}

static const char *execute(struct hs_glove *glove, const struct hs_command *command)
{
    switch (command->type) {
    case HS_IDENTIFY: hs_glove_describe(glove); return NULL;
    case HS_CONFIGURE: return configure(glove, &command->of.configure);
    case HS_START: start(glove); return NULL;
    case HS_STOP: glove->running = false; return NULL;
    case HS_CUE:
        return board_show_cue(command->of.task) ? NULL
                                                : "this glove has nothing to show that task with";
    case HS_READ_CALIBRATION: return read_calibration(glove, command->of.slot);
    default: return write_calibration(glove, command);
    }
}

void hs_glove_execute(struct hs_glove *glove, const struct hs_frame *frame)
{
    struct hs_command command;
    if (frame->type < HS_IDENTIFY) {
        return; /* no command: passed over */
    }
    const enum hs_reply_code code = hs_read_command(frame, &command);
    if (code != HS_DONE) {
        reply(glove, frame->type, code,
              code == HS_UNKNOWN_COMMAND ? "unknown command"
                                         : "the payload does not make this command");
        return;
    }
    if (command.type == HS_PING) {
        hs_write_pong(hs_outbox_begin(&glove->outbox, HS_PONG), command.of.token, board_now());
        hs_outbox_end(&glove->outbox);
        return;
    }
    if (glove->running && (command.type == HS_CONFIGURE || command.type == HS_WRITE_CALIBRATION)) {
        reply(glove, command.type, HS_BUSY, "stop first");
        return;
    }
    const char *refusal = execute(glove, &command);
    reply(glove, command.type, refusal == NULL ? HS_DONE : HS_BAD_ARGUMENT,
          refusal == NULL ? "" : refusal);
}

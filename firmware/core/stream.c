/* Samples of a strip on the common grid, in bursts; what a chip is set to for that. */
#include "core/glove.h"

#define BURST_SECONDS 0.01
#define LATE                                                                                       \
    (40 * HS_MILLISECOND) /* a sensor that is later than that is missing from the burst            \
                           */

bool hs_stream_choose(struct hs_stream *stream)
{
    /* Twice the rate where the chip can: the mean over a grid interval then has two samples and
     * more */
    return stream->driver->choose((float)(2 * stream->rate), stream->ranges, &stream->setting) ||
           stream->driver->choose((float)stream->rate, stream->ranges, &stream->setting);
}

void hs_stream_configure(struct hs_stream *stream, uint8_t count)
{
    for (uint8_t k = 0; k < count; k++) {
        struct hs_sensor *sensor = &stream->sensors[k];
        sensor->setting = stream->setting;
        if (sensor->phase == HS_RUNNING || sensor->phase == HS_SETTLING) {
            hs_sensor_configure(sensor);
        }
    }
}

void hs_strip_describe_streams(struct hs_glove *glove, const struct hs_strip *strip)
{
    for (int which = 0; strip->state == HS_ATTACHED && which < 2; which++) {
        const struct hs_stream *stream = &strip->streams[which];
        if (stream->driver == NULL) {
            continue;
        }
        struct hs_stream_info info = {
            stream->number, strip->layout->slot, 0,   stream->driver->quantities,
            stream->format, stream->rate,        {0}, {0}};
        for (int q = 0; q < 2; q++) {
            info.scale[q] = stream->format == HS_INT16 ? stream->setting.scale[q] : 1.0f;
            info.full_scale[q] = stream->setting.full_scale[q];
        }
        hs_write_stream_info(hs_outbox_begin(&glove->outbox, HS_STREAM_INFO), &info);
        hs_outbox_end(&glove->outbox);
    }
}

/* The next time of the common grid after now, a period away at least; samples are numbered from
 * there. */
static struct hs_grid next_grid(const struct hs_glove *glove, double rate)
{
    const double passed = (double)(board_now() - glove->origin) * 1e-9 * rate;
    return hs_grid_at(glove->origin + (uint64_t)((double)((uint64_t)passed + 2) * 1e9 / rate),
                      rate);
}

/* Begin where every sensor runs or is absent; let sensors that came later join. */
static void begin(const struct hs_glove *glove, struct hs_strip *strip, struct hs_stream *stream)
{
    uint8_t measuring = 0, waiting = 0;
    for (uint8_t k = 0; k < strip->count; k++) {
        const struct hs_sensor *sensor = &stream->sensors[k];
        const bool gives = sensor->phase == HS_RUNNING && sensor->readings > 1;
        measuring = (uint8_t)(measuring + (gives ? 1 : 0));
        waiting = (uint8_t)(waiting + (sensor->phase != HS_ABSENT && !gives ? 1 : 0));
    }
    if (!stream->flowing && measuring > 0 && waiting == 0) {
        stream->flowing = true;
        stream->next = next_grid(glove, stream->rate);
        for (uint8_t k = 0; k < strip->count; k++) {
            stream->sensors[k].resampler.running = false;
        }
    }
    for (uint8_t k = 0; stream->flowing && k < strip->count; k++) {
        struct hs_sensor *sensor = &stream->sensors[k];
        if (sensor->phase == HS_RUNNING && !sensor->resampler.running) {
            hs_resampler_start(&sensor->resampler, stream->next);
        }
    }
}

static uint8_t burst_length(const struct hs_strip *strip, const struct hs_stream *stream)
{
    const size_t sample =
        (size_t)strip->count * stream->driver->axes * (stream->format == HS_INT16 ? 2 : 4);
    const size_t room = (HS_BODY - 32) / sample,
                 wanted = (size_t)(BURST_SECONDS * stream->rate + 0.5);
    const size_t n = wanted < 1 ? 1 : wanted > 255 ? 255 : wanted;
    return (uint8_t)(n < room ? n : room);
}

static bool is_complete(const struct hs_strip *strip, const struct hs_stream *stream, uint8_t n)
{
    for (uint8_t k = 0; k < strip->count; k++) {
        const struct hs_sensor *sensor = &stream->sensors[k];
        if (sensor->phase == HS_RUNNING &&
            (int32_t)(sensor->resampler.grid.index - stream->next.index - n) < 0) {
            return board_now() > stream->next.t + (uint64_t)stream->next.period * n + LATE;
        }
    }
    return true;
}

static void put_sample(struct hs_writer *w, const struct hs_stream *stream,
                       const struct hs_sensor *sensor, uint32_t index)
{
    const int16_t *value = hs_resampler_at(&sensor->resampler, index);
    for (uint8_t axis = 0; axis < stream->driver->axes; axis++) {
        if (stream->format == HS_INT16) {
            hs_put_uint(w, (uint16_t)(value != NULL ? value[axis] : HS_MISSING), 2);
        } else if (value != NULL) {
            hs_put_f32(w, (float)value[axis] * stream->setting.scale[axis / 3]);
        } else {
            hs_put_uint(w, 0x7fc00000u, 4); /* NaN */
        }
    }
}

static void send_burst(struct hs_glove *glove, const struct hs_strip *strip,
                       struct hs_stream *stream, uint8_t n)
{
    const struct hs_burst head = {stream->number, stream->next.index, stream->next.t, board_now(),
                                  n};
    struct hs_writer *w = hs_outbox_begin(&glove->outbox, HS_SAMPLES);
    hs_write_burst(w, &head);
    for (uint8_t j = 0; j < n; j++) {
        for (uint8_t k = 0; k < strip->count; k++) {
            put_sample(w, stream, &stream->sensors[k], stream->next.index);
        }
        hs_grid_step(&stream->next);
    }
    hs_outbox_end(&glove->outbox);
}

void hs_stream_send(struct hs_glove *glove, struct hs_strip *strip, struct hs_stream *stream)
{
    const uint8_t n = burst_length(strip, stream);
    if (!glove->running) {
        stream->flowing = false;
        return;
    }
    begin(glove, strip, stream);
    while (stream->flowing &&
           stream->next.t + (uint64_t)stream->next.period * (n - 1u) < board_now() &&
           is_complete(strip, stream, n)) {
        send_burst(glove, strip, stream, n);
    }
}

#include "core/glove.h"

static const char *refusal_of(const struct hs_layout *layout)
{
    size_t sensors = 0;
    if (layout->count > HS_STRIPS) {
        return "more strips than HS_STRIPS; compile with a larger number";
    }
    for (uint8_t k = 0; k < layout->count; k++) {
        const struct hs_strip_layout *strip = &layout->strips[k];
        if (strip->count == 0 || strip->count > HS_PER_STRIP || strip->slot > 126) {
            return "a strip has 1 to HS_PER_STRIP sensors and a slot of 0 to 126";
        }
        for (uint8_t j = 0; j < k; j++) {
            if (layout->strips[j].slot == strip->slot) {
                return "two strips claim one slot";
            }
        }
        sensors +=
            strip->count * (size_t)((strip->drivers[0] != NULL) + (strip->drivers[1] != NULL));
    }
    return sensors > HS_SENSORS ? "more sensors than HS_SENSORS; compile with a larger number"
                                : NULL;
}

static void identify(struct hs_glove *glove)
{
    hs_write_identity(hs_outbox_begin(&glove->outbox, HS_IDENTITY), &glove->identity);
    hs_outbox_end(&glove->outbox);
}

const char *hs_glove_start(struct hs_glove *glove, const struct hs_layout *layout)
{
    const char *refusal = refusal_of(layout);
    if (refusal != NULL) {
        return refusal;
    }
    memset(glove, 0, sizeof *glove);
    glove->layout = layout;
    glove->count = layout->count;
    glove->identity = (struct hs_identity){layout->device_id, board_random(), layout->hand,
                                           layout->name, HS_FIRMWARE};
    identify(glove);
    for (uint8_t k = 0; k < glove->count; k++) {
        glove->strips[k].layout = &layout->strips[k];
        hs_strip_start(glove, &glove->strips[k]);
    }
    return NULL;
}

static void send(struct hs_glove *glove)
{
    const uint8_t *bytes;
    size_t n = hs_outbox_peek(&glove->outbox, &bytes), taken = n;
    while (n > 0 && taken == n) {
        taken = board_send(bytes, n);
        hs_outbox_drop(&glove->outbox, taken);
        if (taken == n) {
            n = taken = hs_outbox_peek(&glove->outbox, &bytes);
        }
    }
}

void hs_glove_describe(struct hs_glove *glove)
{
    identify(glove);
    for (uint8_t k = 0; k < glove->count; k++) {
        hs_strip_describe(glove, &glove->strips[k]);
        send(glove); /* many strips have more to say than waits */
    }
    if (glove->layout->plate != NULL) {
        hs_write_plate(hs_outbox_begin(&glove->outbox, HS_PLATE), glove->layout->plate);
        hs_outbox_end(&glove->outbox);
    }
    for (uint8_t k = 0; k < glove->count; k++) {
        hs_strip_describe_streams(glove, &glove->strips[k]);
    }
}

/* Of the first sensor that has a thermometer and runs; 0 where none does. */
static float temperature_of(struct hs_glove *glove)
{
    float celsius = 0;
    for (uint8_t k = 0; k < glove->count; k++) {
        const struct hs_stream *stream = &glove->strips[k].streams[0];
        if (stream->driver != NULL && stream->sensors[0].phase == HS_RUNNING &&
            stream->driver->temperature(&stream->sensors[0].bus, &celsius)) {
            return celsius;
        }
    }
    return celsius;
}

static void announce(struct hs_glove *glove)
{
    const uint64_t now = board_now();
    if (!glove->running || now - glove->announced < HS_SECOND) {
        return;
    }
    glove->announced +=
        now - glove->announced < 2 * (uint64_t)HS_SECOND ? HS_SECOND : now - glove->announced;
    hs_glove_describe(glove);
    hs_write_status(hs_outbox_begin(&glove->outbox, HS_STATUS), now, glove->outbox.overruns,
                    board_battery(), temperature_of(glove));
    hs_outbox_end(&glove->outbox);
}

static void watch_supply(struct hs_glove *glove)
{
    const bool low = board_supply_is_low();
    if (low && !glove->supply_was_low) {
        hs_glove_mark(glove, board_now(), 0, "supply_low", NULL);
    }
    glove->supply_was_low = low;
}

static void receive(struct hs_glove *glove)
{
    uint8_t bytes[64];
    struct hs_frame frame;
    const size_t n = board_receive(bytes, sizeof bytes);
    for (size_t k = 0; k < n; k++) {
        if (hs_frame_reader_push(&glove->inbox, bytes[k], &frame)) {
            hs_glove_execute(glove, &frame);
        }
    }
}

void hs_glove_poll(struct hs_glove *glove)
{
    board_feed_watchdog();
    receive(glove);
    for (uint8_t k = 0; k < glove->count; k++) {
        hs_strip_poll(glove, &glove->strips[k]);
        if (glove->outbox.used > HS_OUTBOX / 2) {
            send(glove);
        }
    }
    announce(glove);
    watch_supply(glove);
    send(glove);
}

void hs_glove_mark(struct hs_glove *glove, uint64_t t, uint64_t duration, const char *trial_type,
                   const char *const *pairs)
{
    hs_write_mark(hs_outbox_begin(&glove->outbox, HS_MARK), t, duration, trial_type, pairs);
    hs_outbox_end(&glove->outbox);
}

void hs_glove_hang_up(struct hs_glove *glove)
{
    glove->running = false;
    glove->inbox.n = 0;
    glove->inbox.skipping = false;
    hs_outbox_clear(&glove->outbox);
}

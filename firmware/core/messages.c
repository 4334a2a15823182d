#include "core/messages.h"

uint8_t hs_quantities_of(uint8_t mask)
{
    uint8_t n = 0;
    for (; mask != 0; mask = (uint8_t)(mask & (mask - 1))) {
        n++;
    }
    return n;
}

void hs_write_identity(struct hs_writer *w, const struct hs_identity *m)
{
    hs_put_uint(w, HS_VERSION, 2);
    hs_put_uint(w, m->device_id, 8);
    hs_put_uint(w, m->boot_id, 4);
    hs_put_uint(w, m->hand, 1);
    hs_put_text(w, m->name);
    hs_put_text(w, m->firmware);
}

void hs_write_strip(struct hs_writer *w, uint8_t slot, bool attached, uint64_t strip_id, uint8_t n,
                    const uint8_t *points, const float *mounting)
{
    hs_put_uint(w, slot, 1);
    hs_put_uint(w, attached ? 3 : 2, 1); /* bit 1: samples are raw */
    hs_put_uint(w, strip_id, 8);
    hs_put_uint(w, n, 1);
    hs_put(w, points, n);
    for (int k = 0; mounting != NULL && k < 4 * n; k++) {
        hs_put_f32(w, mounting[k % 4]);
    }
}

void hs_write_stream_info(struct hs_writer *w, const struct hs_stream_info *m)
{
    const uint8_t n = hs_quantities_of(m->quantities);
    hs_put_uint(w, m->stream, 1);
    hs_put_uint(w, m->slot, 1);
    hs_put_uint(w, m->clock, 1);
    hs_put_uint(w, m->quantities, 1);
    hs_put_uint(w, m->format, 1);
    hs_put_f64(w, m->rate);
    for (uint8_t k = 0; k < n; k++) {
        hs_put_f32(w, m->scale[k]);
    }
    for (uint8_t k = 0; k < n; k++) {
        hs_put_f32(w, m->full_scale[k]);
    }
}

void hs_write_burst(struct hs_writer *w, const struct hs_burst *m)
{
    hs_put_uint(w, m->stream, 1);
    hs_put_uint(w, m->index, 4);
    hs_put_uint(w, m->t_first, 8);
    hs_put_uint(w, m->t_sent, 8);
    hs_put_uint(w, m->count, 1);
}

void hs_write_status(struct hs_writer *w, uint64_t t, uint32_t overruns, uint8_t battery,
                     float celsius)
{
    hs_put_uint(w, t, 8);
    hs_put_uint(w, overruns, 4);
    hs_put_uint(w, battery, 1);
    hs_put_f32(w, celsius);
}

void hs_write_reply(struct hs_writer *w, uint8_t command, enum hs_reply_code code, const char *text)
{
    hs_put_uint(w, command, 1);
    hs_put_uint(w, code, 1);
    hs_put_text(w, text);
}

void hs_write_pong(struct hs_writer *w, uint64_t token, uint64_t t)
{
    hs_put_uint(w, token, 8);
    hs_put_uint(w, t, 8);
}

void hs_write_calibration(struct hs_writer *w, uint8_t slot, uint8_t sensor,
                          const struct hs_calibration *m)
{
    hs_put_uint(w, slot, 1);
    hs_put_uint(w, sensor, 1);
    hs_put_calibration(w, m);
}

void hs_write_mark(struct hs_writer *w, uint64_t t, uint64_t duration, const char *trial_type,
                   const char *const *pairs)
{
    hs_put_uint(w, t, 8);
    hs_put_uint(w, duration, 8);
    hs_put_text(w, trial_type);
    for (; pairs != NULL && pairs[0] != NULL && pairs[1] != NULL; pairs += 2) {
        hs_put_text(w, pairs[0]);
        hs_put_text(w, pairs[1]);
    }
}

void hs_write_plate(struct hs_writer *w, const struct hs_plate *m)
{
    hs_put_f32(w, m->earth);
    hs_put_f32(w, m->dip);
    for (int k = 0; k < 3; k++) {
        hs_put_f32(w, m->moment[k]);
    }
    for (int k = 0; k < 3; k++) {
        hs_put_f32(w, m->place[k]);
    }
    hs_put_uint(w, m->n, 1);
    for (uint8_t j = 0; j < m->n; j++) {
        hs_put_uint(w, m->points[j], 1);
        for (int k = 0; k < 3; k++) {
            hs_put_f32(w, m->places[j][k]);
        }
    }
}

void hs_put_calibration(struct hs_writer *w, const struct hs_calibration *m)
{
    for (int k = 0; k < 9; k++) {
        hs_put_f32(w, m->bias[k]);
    }
    for (int k = 0; k < 27; k++) {
        hs_put_f32(w, m->matrix[k]);
    }
}

void hs_get_calibration(struct hs_reader *r, struct hs_calibration *m)
{
    for (int k = 0; k < 9; k++) {
        m->bias[k] = hs_get_f32(r);
    }
    for (int k = 0; k < 27; k++) {
        m->matrix[k] = hs_get_f32(r);
    }
}

void hs_identity_calibration(struct hs_calibration *m)
{
    memset(m, 0, sizeof *m);
    for (int k = 0; k < 27; k++) {
        m->matrix[k] = k % 9 % 4 == 0 ? 1.0f : 0.0f;
    }
}

bool hs_is_finite(const struct hs_calibration *m)
{
    for (int k = 0; k < 36; k++) {
        const float x = k < 9 ? m->bias[k] : m->matrix[k - 9];
        if (!(x - x == 0.0f)) { /* NaN and infinity alone differ from themselves */
            return false;
        }
    }
    return true;
}

static void read_configure(struct hs_reader *r, struct hs_configure *c)
{
    c->slot = (uint8_t)hs_get_uint(r, 1);
    c->rate = hs_get_f64(r);
    c->mag_rate = hs_get_f64(r);
    c->gyr_range = hs_get_f32(r);
    c->acc_range = hs_get_f32(r);
    c->format = (uint8_t)hs_get_uint(r, 1);
}

static void read_cue(struct hs_reader *r, char *task)
{
    char passed_over[2];
    hs_get_text(r, task, HS_TEXT);
    while (!r->short_of && r->at < r->size) {
        hs_get_text(r, passed_over, sizeof passed_over);
        hs_get_text(r, passed_over, sizeof passed_over);
    }
}

enum hs_reply_code hs_read_command(const struct hs_frame *frame, struct hs_command *command)
{
    struct hs_reader r = {frame->payload, frame->size, 0, false};
    command->type = frame->type;
    switch (frame->type) {
    case HS_IDENTIFY:
    case HS_START:
    case HS_STOP: return HS_DONE;
    case HS_CONFIGURE: read_configure(&r, &command->of.configure); break;
    case HS_PING: command->of.token = hs_get_uint(&r, 8); break;
    case HS_CUE: read_cue(&r, command->of.task); break;
    case HS_READ_CALIBRATION: command->of.slot = (uint8_t)hs_get_uint(&r, 1); break;
    case HS_WRITE_CALIBRATION:
        command->of.write.slot = (uint8_t)hs_get_uint(&r, 1);
        command->of.write.sensor = (uint8_t)hs_get_uint(&r, 1);
        hs_get_calibration(&r, &command->of.write.calibration);
        break;
    default: return HS_UNKNOWN_COMMAND;
    }
    return r.short_of || r.at != r.size ? HS_BAD_ARGUMENT : HS_DONE;
}

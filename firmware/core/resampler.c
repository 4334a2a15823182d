#include "core/resampler.h"

#include <string.h>

struct hs_grid hs_grid_at(uint64_t t, double rate)
{
    const double period = 1e9 / rate;
    const uint32_t whole = (uint32_t)period;
    return (struct hs_grid){
        .t = t, .period = whole, .period_fraction = (uint32_t)((period - whole) * 4294967296.0)};
}

void hs_grid_step(struct hs_grid *grid)
{
    const uint32_t before = grid->fraction;
    grid->fraction += grid->period_fraction;
    grid->t += grid->period + (grid->fraction < before ? 1u : 0u);
    grid->index++;
}

static void begin_interval(struct hs_resampler *r, uint64_t start)
{
    r->start = start;
    r->covered = 0;
    memset(r->sum, 0, sizeof r->sum);
    memset(r->at_limit, 0, sizeof r->at_limit);
}

void hs_resampler_start(struct hs_resampler *r, struct hs_grid grid)
{
    r->grid = grid;
    r->running = true;
    for (int k = 0; k < HS_RING; k++) {
        r->index_of[k] = grid.index - 1 - HS_RING; /* none of this grid */
    }
    begin_interval(r, grid.t - grid.period);
}

static void cover(struct hs_resampler *r, uint64_t from, uint64_t to, const int16_t *value)
{
    from = from > r->start ? from : r->start;
    if (to <= from) {
        return;
    }
    for (int k = 0; k < r->axes; k++) {
        r->sum[k] += (int64_t)value[k] * (int64_t)(to - from);
        if (value[k] >= r->limit[k] || value[k] <= -r->limit[k]) {
            r->at_limit[k] = value[k] > -32768 ? value[k] : -32767;
        }
    }
    r->covered += to - from;
}

static int16_t rounded(int64_t sum, int64_t n)
{
    return (int16_t)((sum >= 0 ? sum + n / 2 : sum - n / 2) / n);
}

static void complete(struct hs_resampler *r)
{
    if (r->covered + 2 >= r->grid.period) {
        const uint32_t at = r->grid.index % HS_RING;
        for (int k = 0; k < r->axes; k++) {
            const int16_t mean = rounded(r->sum[k], (int64_t)r->covered);
            r->value[at][k] = r->at_limit[k] != 0 ? r->at_limit[k] : mean > -32768 ? mean : -32767;
        }
        r->index_of[at] = r->grid.index;
    }
    begin_interval(r, r->grid.t);
    hs_grid_step(&r->grid);
}

void hs_resampler_push(struct hs_resampler *r, uint64_t t, const int16_t *value)
{
    const uint64_t before = r->newest;
    if (t <= before) {
        return;
    }
    const bool gap = before == 0 || t - before > r->gap;
    r->newest = t;
    if (!r->running) {
        return;
    }
    while (r->grid.t <= t) {
        if (!gap) {
            cover(r, before, r->grid.t, value);
        }
        complete(r);
    }
    if (!gap) {
        cover(r, before, t, value);
    }
}

const int16_t *hs_resampler_at(const struct hs_resampler *r, uint32_t index)
{
    return r->index_of[index % HS_RING] == index ? r->value[index % HS_RING] : NULL;
}

#include "boards/simulated/world.h"

struct sim_world sim;

uint32_t sim_draw(void)
{
    sim.random = sim.random * 1664525u + 1013904223u;
    return sim.random >> 8;
}

static void add_chip(const struct hs_strip_layout *strip, int which, uint8_t k)
{
    struct sim_chip *chip = &sim.chips[sim.count++];
    const bool alone = which == 0 || strip->drivers[0] == NULL;
    const uint8_t address = strip->i2c_address[which];
    *chip = (struct sim_chip){.bus = {strip->slot, (uint8_t)(alone ? k : k + HS_PER_STRIP),
                                      (uint8_t)(address == 0 ? 0 : address + k)},
                              .kind = strip->drivers[which],
                              .point = strip->points[k],
                              .mounting = strip->mounting,
                              .error_ppm = (int32_t)(sim_draw() % 20001) - 10000};
    for (int axis = 0; axis < chip->kind->axes; axis++) {
        chip->bias[axis] = (int16_t)((int32_t)(sim_draw() % 33) - 16); /* about 1 deg/s, 8 mg */
    }
    sim_chip_power(chip);
}

void sim_start(const struct hs_layout *layout, uint32_t seed, bool with_memory)
{
    memset(&sim, 0, sizeof sim);
    sim.random = seed;
    sim.hand = layout->hand;
    sim.supply = -1;
    for (uint8_t s = 0; s < layout->count; s++) {
        const struct hs_strip_layout *strip = &layout->strips[s];
        sim.slot[s] = strip->slot;
        sim.plugged[s] = true;
        sim.memory[s].present = with_memory;
        memset(sim.memory[s].bytes, 0xFF, SIM_MEMORY);
        for (int which = 0; which < 2; which++) {
            for (uint8_t k = 0; strip->drivers[which] != NULL && k < strip->count; k++) {
                add_chip(strip, which, k);
            }
        }
    }
    sim.strips = layout->count;
}

static int place_of(uint8_t slot)
{
    for (uint8_t s = 0; s < sim.strips; s++) {
        if (sim.slot[s] == slot) {
            return s;
        }
    }
    return -1;
}

struct sim_chip *sim_chip_at(uint8_t slot, uint8_t select)
{
    for (uint32_t k = 0; k < sim.count; k++) {
        if (sim.chips[k].bus.slot == slot && sim.chips[k].bus.select == select) {
            return &sim.chips[k];
        }
    }
    return NULL;
}

void sim_plug(uint8_t slot, bool plugged)
{
    const int place = place_of(slot);
    if (place < 0 || sim.plugged[place] == plugged) {
        return;
    }
    sim.plugged[place] = plugged;
    for (uint32_t k = 0; plugged && k < sim.count; k++) {
        if (sim.chips[k].bus.slot == slot) {
            sim_chip_power(&sim.chips[k]);
        }
    }
}

bool sim_transfer(const struct hs_bus *bus, const uint8_t *out, size_t n_out, uint8_t *in,
                  size_t n_in)
{
    const int place = place_of(bus->slot);
    const bool there = place >= 0 && sim.plugged[place];
    if (n_in > 0) {
        memset(in, 0, n_in); /* a line that nobody drives is pulled down */
    }
    if (bus->select == HS_SELECT_MEMORY) {
        return !there || !sim.memory[place].present ||
               sim_memory_transfer(&sim.memory[place], out, n_out, in, n_in);
    }
    struct sim_chip *chip = sim_chip_at(bus->slot, bus->select);
    if (!there || chip == NULL || chip->broken) {
        return bus->i2c_address == 0; /* by SPI nobody notices */
    }
    sim_chip_transfer(chip, out, n_out, in, n_in);
    return true;
}

bool sim_memory_transfer(struct sim_eeprom *m, const uint8_t *out, size_t n_out, uint8_t *in,
                         size_t n_in)
{
    const uint16_t address = n_out >= 3 ? (uint16_t)((out[1] << 8 | out[2]) % SIM_MEMORY) : 0;
    const bool busy = board_now() < m->busy_until;
    if (out[0] == 0x05) {
        for (size_t k = 0; k < n_in; k++) {
            in[k] = (uint8_t)((busy ? 1 : 0) | (m->latch ? 2 : 0));
        }
    } else if (busy) {
        return true; /* a chip that writes takes no command */
    } else if (out[0] == 0x06 || out[0] == 0x04) {
        m->latch = out[0] == 0x06;
    } else if (out[0] == 0x03) {
        for (size_t k = 0; k < n_in; k++) {
            in[k] = m->bytes[(address + k) % SIM_MEMORY];
        }
    } else if (out[0] == 0x02 && m->latch) {
        for (size_t k = 3; k < n_out; k++) {
            if (sim.supply == 0) {
                m->bytes[address] =
                    (uint8_t)sim_draw(); /* the byte at which the power failed holds anything */
                return false;
            }
            sim.supply -= sim.supply > 0 ? 1 : 0;
            m->bytes[(address & ~31u) | ((address + k - 3) & 31u)] = out[k];
        }
        m->latch = false;
        m->busy_until = board_now() + 3 * HS_MILLISECOND;
    }
    return true;
}

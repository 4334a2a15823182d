#include "core/hand_layout.h"

const float *hs_mounting_on(uint8_t hand)
{
    static const float left[4] = {0.70710678f, 0, 0.70710678f, 0},
                       right[4] = {0, 0.70710678f, 0, -0.70710678f};
    return hand == HS_RIGHT ? right : left; /* frames of segments: docs/conventions.md */
}

static const struct {
    const char *name;
    uint8_t slot, first, count;
} known[] = {
    {"hand", 0, HS_ON_HAND, 1},        {"thumb", 1, HS_THUMB, 3},
    {"index", 2, HS_INDEX, 3},         {"middle", 3, HS_MIDDLE, 3},
    {"ring", 4, HS_RING_FINGER, 3},    {"little", 5, HS_LITTLE, 3},
    {"forearm", 6, HS_FOREARM, 1},     {"trunk", 7, HS_TRUNK, 1},
    {"trunk_mag", 9, HS_TRUNK_MAG, 4},
};

static bool add(const char *name, size_t n, uint8_t hand, const struct hs_driver *inertial,
                struct hs_strip_layout *strip)
{
    for (size_t k = 0; k < sizeof known / sizeof known[0]; k++) {
        if (strlen(known[k].name) != n || strncmp(known[k].name, name, n) != 0) {
            continue;
        }
        const bool magnetic = known[k].first == HS_TRUNK_MAG, trunk = known[k].first >= HS_TRUNK;
        *strip = (struct hs_strip_layout){.slot = known[k].slot, .count = known[k].count};
        strip->drivers[magnetic ? 1 : 0] = magnetic ? &hs_mmc5983ma : inertial;
        strip->mounting = trunk ? NULL : hs_mounting_on(hand);
        for (uint8_t j = 0; j < strip->count; j++) {
            strip->points[j] = (uint8_t)(known[k].first + j);
        }
        return true;
    }
    return false;
}

uint8_t hs_hand_layout(const char *names, uint8_t hand, const struct hs_driver *inertial,
                       struct hs_strip_layout *strips)
{
    uint8_t count = 0;
    while (*names != 0) {
        const size_t n = strcspn(names, ",");
        if (count == HS_STRIPS || !add(names, n, hand, inertial, &strips[count])) {
            return 0;
        }
        count++;
        names += names[n] == ',' ? n + 1 : n;
    }
    return count;
}

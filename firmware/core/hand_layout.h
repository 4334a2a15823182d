/* Strips of a whole hand, and how a chip that lies flat on the back of a segment sits on it. */
#ifndef HS_HAND_LAYOUT_H
#define HS_HAND_LAYOUT_H

#include "core/glove.h"

/* Strips by name, separated by commas (hand, thumb, index, middle, ring, little, forearm, trunk,
 * trunk_mag), into `strips` of HS_STRIPS; how many, 0 where a name is not known. Slots are 0 to 6
 * in the order of these names, 7 trunk, 9 trunk_mag. */
uint8_t hs_hand_layout(const char *names, uint8_t hand, const struct hs_driver *inertial,
                       struct hs_strip_layout *strips);

/* q_BS of a chip that lies flat on the back of a segment, its y axis to the fingertip, its z axis
 * off the skin. */
const float *hs_mounting_on(uint8_t hand);

#define HS_WHOLE_HAND "hand,thumb,index,middle,ring,little,forearm"

#endif

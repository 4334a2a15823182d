/* Sizes that are fixed when the firmware is compiled: there is no heap. Each may be set with -D. */
#ifndef HS_LIMITS_H
#define HS_LIMITS_H

#ifndef HS_STRIPS
#define HS_STRIPS 10 /* connectors for strips, at most 127: a strip has two stream numbers */
#endif
#ifndef HS_PER_STRIP
#define HS_PER_STRIP 8 /* sensors of one strip */
#endif
#ifndef HS_SENSORS
#define HS_SENSORS                                                                                 \
    32 /* sensors of all strips; an inertial one and a magnetometer at one point are two */
#endif
#ifndef HS_OUTBOX
#define HS_OUTBOX 16384 /* bytes that wait for a slow host: 0.25 s of 17 sensors at 200 Hz */
#endif
#define HS_FRAME 4096 /* bytes of a frame on the wire before its zero byte, by the protocol */
#define HS_BODY 2048  /* bytes of a frame of ours before it is stuffed */
#define HS_RING 64    /* resampled samples of a sensor that wait for the others of its strip */
#define HS_PAGE 2048  /* bytes of one copy of a strip's memory */
#define HS_AXES 6     /* numbers of one sensor's sample */
#define HS_TEXT 64    /* bytes of a command's text that are looked at */

#define HS_MILLISECOND 1000000u /* ns */
#define HS_SECOND 1000000000u   /* ns */

#if HS_STRIPS > 127
#error "a stream number is one byte: at most 127 strips"
#endif

#endif

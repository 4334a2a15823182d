"""The English words of the checks' messages, by code; other languages translate them by these originals."""

from handscope.estimators.fault_detection.finding import Message

SENTENCES = {
    "file.time_runs_back": (
        "The times in the file run back {count} times, first at {at} s. Rows are in the wrong"
        " order or two recordings were joined: sort the rows by the sensors' own clock, or "
        "export the recording again."
    ),
    "file.frozen": (
        "All sensors of a strip repeat one reading for up to {seconds} s, first at {at} s: "
        "the link or the program that wrote the file stood still. Angles behind it are not to"
        " be trusted before the hand rests again; record that part again. Chance repeats rows"
        " so often in less than 1 of {odds} recordings."
    ),
    "file.lost_rows": (
        "All sensors jump at {at} s and gravity is elsewhere behind it: rows were dropped "
        "there (very roughly {seconds} s) and the times do not show it. Export the recording "
        "with the sensors' time stamps, or record again. Without a loss, less than 1 of "
        "{odds} recordings shows such a jump."
    ),
    "file.accelerometer_unit": (
        "All accelerometers read about {size} at rest: this looks like {unit}. Tell the unit,"
        " or multiply the accelerations by {factor} to get m/s^2."
    ),
    "file.accelerometer_negated": (
        "{count} accelerometers read gravity upside down in the initial pose. Either they "
        "tell acceleration with the opposite sign (at rest they have to read +9.81 m/s^2 "
        "upwards), the pose was held upside down, or the recording is of the other hand. "
        "Negate the accelerations, or tell the other hand."
    ),
    "file.rate": (
        "All gyroscopes turn {percent} percent too far or too short for the times in the file"
        " (true rate {factor} times the one told in turning): the sampling rate is probably "
        "told wrong, or all gyroscopes have another range than told. Give the true rate, or "
        "export with time stamps. Right rates show as much in less than 1 of {odds} "
        "recordings."
    ),
    "file.gyroscope_sign": (
        "The {axis} axis of all gyroscopes has the wrong sign against the accelerometers: the"
        " program that wrote the file has negated it. Negate it again. Right gyroscopes look "
        "so in less than 1 of {odds} recordings."
    ),
    "file.gyroscope_negated": (
        "All gyroscopes turn the opposite way to gravity in the accelerometers: left-handed "
        "axes, negated rates, or samples in reversed order. Negate all rates, or write the "
        "samples in the order they were taken. Right gyroscopes look so in less than 1 of "
        "{odds} recordings."
    ),
    "file.gyroscope_exchange": (
        "The {axis} and {other} axes of all gyroscopes are exchanged against the "
        "accelerometers. Exchange the two columns. Right gyroscopes look so in less than 1 of"
        " {odds} recordings."
    ),
    "file.gyroscope_unit": (
        "All gyroscopes read {factor} times as much as gravity turns: they look like {unit}. "
        "Tell the unit. Right gyroscopes look so in less than 1 of {odds} recordings."
    ),
    "file.gyroscope_axes": (
        "The axes of all gyroscopes do not lie as the accelerometers' do: x, y, z of the "
        "accelerometers are {axes} of the gyroscopes. Put the columns in this order with "
        "these signs. Right gyroscopes look so in less than 1 of {odds} recordings."
    ),
    "file.accelerometer_sign": (
        "The {axis} axis of all accelerometers has the wrong sign against the gyroscopes, or "
        "the two other axes of the gyroscopes have. Check the axes in the file's description."
        " Right sensors look so in less than 1 of {odds} recordings."
    ),
    "file.accelerometer_exchange": (
        "The {axis} and {other} axes of all accelerometers are exchanged against the "
        "gyroscopes. Exchange the two columns. Right sensors look so in less than 1 of {odds}"
        " recordings."
    ),
    "sensor.gyroscope_sign": (
        "{sensor}: the {axis} axis of its gyroscope has the wrong sign. Negate it in the "
        "strip's calibration. A right gyroscope looks so in less than 1 of {odds} recordings."
    ),
    "sensor.gyroscope_negated": (
        "{sensor}: its gyroscope turns the opposite way to gravity in its accelerometer. "
        "Negate its three rates. A right gyroscope looks so in less than 1 of {odds} "
        "recordings."
    ),
    "sensor.gyroscope_exchange": (
        "{sensor}: the {axis} and {other} axes of its gyroscope are exchanged. Exchange the "
        "two columns. A right gyroscope looks so in less than 1 of {odds} recordings."
    ),
    "sensor.gyroscope_unit": (
        "{sensor}: its gyroscope reads {factor} times as much as gravity turns: it looks like"
        " {unit}. Tell the unit. A right gyroscope looks so in less than 1 of {odds} "
        "recordings."
    ),
    "sensor.gyroscope_axes": (
        "{sensor}: the axes of its gyroscope do not lie as its accelerometer's do: x, y, z of"
        " the accelerometer are {axes} of the gyroscope. Correct the strip's calibration. "
        "Right axes look so in less than 1 of {odds} recordings."
    ),
    "sensor.gyroscope_gain": (
        "{sensor}: its gyroscope reads {gain} times what gravity turns in its accelerometer. "
        "Calibrate the strip, and check the gyroscope's range. A right gyroscope looks so in "
        "less than 1 of {odds} recordings."
    ),
    "sensor.gyroscope_axis_gain": (
        "{sensor}: the {axis} axis of its gyroscope reads {gain} times what gravity turns. "
        "Calibrate the strip. A right gyroscope looks so in less than 1 of {odds} recordings."
    ),
    "sensor.gyroscope_delay": (
        "{sensor}: its gyroscope is {delay} s behind its accelerometer. Check that both are "
        "read and filtered at the same time. A right sensor looks so in less than 1 of {odds}"
        " recordings."
    ),
    "sensor.gyroscope_matrix": (
        "{sensor}: its gyroscope and its accelerometer do not agree by up to {percent} "
        "percent; no single axis explains it. Calibrate the strip, or change it. A right "
        "sensor looks so in less than 1 of {odds} recordings."
    ),
    "sensor.accelerometer_sign": (
        "{sensor}: the {axis} axis of its accelerometer has the wrong sign, or the two other "
        "axes of its gyroscope have. Check the strip's calibration. A right sensor looks so "
        "in less than 1 of {odds} recordings."
    ),
    "sensor.accelerometer_exchange": (
        "{sensor}: the {axis} and {other} axes of its accelerometer are exchanged. Exchange "
        "the two columns. A right sensor looks so in less than 1 of {odds} recordings."
    ),
    "sensor.accelerometer_size": (
        "{sensor}: its accelerometer reads {size} m/s^2 at rest, gravity is {gravity}. "
        "Calibrate the strip. A right accelerometer reads so in less than 1 of {odds} "
        "recordings."
    ),
    "sensor.accelerometer_negated": (
        "{sensor}: its accelerometer reads gravity upside down in the initial pose. Negate "
        "it, or mount the sensor as drawn."
    ),
    "sensor.magnetometer_axes": (
        "{sensor}: the axes of its magnetometer do not turn as its gyroscope does. Check "
        "signs and order of its axes; leave magnetometers out until then (6D). A right "
        "magnetometer looks so in less than 1 of {odds} recordings."
    ),
    "sensors.exchanged": (
        "The sensors {first} and {second} are probably exchanged: their neighbours meet at "
        "common joints only if each sits in the other's place (without an exchange, less than"
        " 1 of {odds} recordings reads so). Exchange the two and record again, or let the "
        "recording be corrected."
    ),
    "sensors.exchanged_angles": (
        "The sensors {first} and {second} are probably exchanged: as declared they would bend the "
        "finger's joints {beyond_deg} deg beyond their limits, in each other's place they would "
        "not. Exchange the two and record again, or let the recording be corrected."
    ),
    "sensors.order": (
        "The sensors {sensors} probably sit in another order along the finger than declared "
        "(in the declared order, less than 1 of {odds} recordings reads so). Check the order "
        "of the sensors, or let the recording be corrected."
    ),
    "sensors.late": (
        "Samples of {sensors} come {delay_ms} ms too late against their neighbours, from "
        "{start} s to {stop} s (without a delay, less than 1 of {odds} recordings reads so). "
        "Check the strip's clock and cable, or let the delay be removed."
    ),
    "sensors.early": (
        "Samples of {sensors} come {delay_ms} ms too early against their neighbours, from "
        "{start} s to {stop} s (without a shift, less than 1 of {odds} recordings reads so). "
        "Check the strip's clock and cable, or let the shift be removed."
    ),
    "sensor.gain_at_joints": (
        "{sensor}: its gyroscope reads {gain} times what the joints to its neighbours show "
        "(a right gyroscope looks so in less than 1 of {odds} recordings). Calibrate the strip, "
        "and check the gyroscope's range, or let the recording be corrected."
    ),
    "sensors.disagree": (
        "The sensors {first} and {second} do not meet at their common joint: between {start} s and "
        "{stop} s they differ {ratio} times as much as skin and noise explain (those of intact "
        "sensors do in less than 1 of {odds} recordings). One of the two is wrong, late, loose or "
        "elsewhere; which one the movement does not tell. Check both and record again."
    ),
    "sensor.slipped": (
        "The sensor {sensor} turned by about {angle_deg} deg on its segment at {start} s (of "
        "sensors that stayed, less than 1 of {odds} recordings reads so). Fasten it and take "
        "the initial pose again; what was measured after {start} s is not to be trusted for "
        "its joints."
    ),
    "joint.beyond_reach": (
        "{joint}: by its two sensors alone its {angle} would go {beyond_deg} deg beyond {limit_deg} "
        "deg, the limit of this joint, between {start} s and {stop} s. One of the two is probably "
        "late, exchanged, turned on its segment or read wrong; check both and record again. If "
        "this person's joint does go there, the recording is right."
    ),
    "fingers.exchanged": (
        "The strips of {first} and {second} are probably exchanged: their knuckles lie where "
        "the other's should (without an exchange, less than 1 of {odds} recordings reads so)."
        " Exchange the two strips, or let the recording be corrected."
    ),
    "hand.other": (
        "Knuckles and bones lie the other way round than on the declared hand (on the "
        "declared hand, less than 1 of {odds} recordings reads so). Was the other hand "
        "measured? Correct the hand and process the recording again."
    ),
    "hand.mirrored": (
        "Thumb and little finger lie on the wrong sides for the declared hand (on the "
        "declared hand, less than 1 of {odds} recordings reads so). Was the other hand "
        "measured, or are the strips in reverse order?"
    ),
    "geometry.other_hand": (
        "The joint positions that were given are those of the other hand (were they right, "
        "less than 1 of {odds} recordings would read so). Correct the hand's geometry and "
        "process the recording again."
    ),
    "geometry.impossible": (
        "The joint positions that were given put {joints} behind the wrist, as for the other "
        "hand's axes. Correct the hand's geometry and process the recording again."
    ),
    "person.bone_length": (
        "The movement shows a length of {seen_mm} mm for {segment}, the hand was declared "
        "with {declared_mm} mm. Were the lengths measured on this hand, and is the glove this"
        " person's?"
    ),
    "person.angle_beyond": (
        "{joint}: {angle} went {beyond_deg} deg beyond {limit_deg} deg, the limit of this "
        "joint. Can this person's joint do that?"
    ),
    "person.angle_at_limit": (
        "{joint}: {angle} stayed at {limit_deg} deg, the limit of this joint, for much of the"
        " recording. Can that be right?"
    ),
}


def sentence(message: Message) -> str:
    """A message in English: its code's sentence with the values filled in, numbers to three digits."""
    values = {
        name: value if isinstance(value, str) else f"{float(f'{value:.3g}'):.10g}"
        for name, value in message.values.items()
    }
    return SENTENCES[message.code].format(**values)

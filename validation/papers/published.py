"""The papers' figures, to be printed beside ours."""

from collections.abc import Mapping

# Salchow-Hoemmen 2019, Table 6: RMSE of the fingertip's position, cm, subject 1
TABLE6: Mapping[str, Mapping[str, float]] = {
    "A-F1": {"b": 6.1, "m1": 2.2, "m2": 1.8},
    "A-F2": {"b": 3.6, "m1": 0.9, "m2": 1.0},
    "A-F3": {"b": 4.3, "m1": 1.4, "m2": 0.7},
    "AF-F1": {"b": 6.3, "m1": 1.6, "m2": 2.1},
    "AF-F2": {"b": 2.3, "m1": 0.9, "m2": 1.0},
    "AF-F3": {"b": 4.4, "m1": 1.3, "m2": 1.0},
    "F-F2": {"b": 2.1, "m1": 0.6, "m2": 0.6},
    "F-F3": {"b": 4.4, "m1": 1.3, "m2": 0.8},
}

# Salchow-Hoemmen 2019, Table 7: RMSE of the known distance, cm, average of four subjects
TABLE7: Mapping[str, Mapping[str, float]] = {
    "P1 F1-F2": {"b": 2.3, "m1": 9.0, "m2": 0.9},
    "P2 F2-F3": {"b": 2.9, "m1": 1.9, "m2": 1.3},
    "P3 F1-F2": {"b": 4.4, "m1": 10.3, "m2": 2.0},
    "P4 F1-F2": {"b": 1.4, "m1": 5.7, "m2": 0.6},
    "P4 F1-F3": {"b": 2.4, "m1": 9.7, "m2": 1.2},
    "P4 F2-F3": {"b": 2.1, "m1": 5.0, "m2": 1.2},
}

# Total RMSE in deg per trial of Madgwick's and Mahony's filters, parameters that do best on average over all trials (TAGP): Laidig et al. 2021
BROAD_FILTERS = ("total Madgwick", "total Mahony")
BROAD: Mapping[str, Mapping[str, float]] = {
    "02_undisturbed_slow_rotation_B": {"total Madgwick": 1.50, "total Mahony": 2.97},
    "06_undisturbed_fast_rotation_A": {"total Madgwick": 2.31, "total Mahony": 4.29},
    "10_undisturbed_slow_translation_A": {"total Madgwick": 3.57, "total Mahony": 2.76},
    "15_undisturbed_fast_translation_A": {"total Madgwick": 12.30, "total Mahony": 9.20},
    "21_undisturbed_fast_combined": {"total Madgwick": 7.16, "total Mahony": 12.44},
    "25_disturbed_tapping_B": {"total Madgwick": 3.92, "total Mahony": 6.04},
    "26_disturbed_phone_vibration_A": {"total Madgwick": 2.90, "total Mahony": 2.27},
    "28_disturbed_stationary_magnet_A": {"total Madgwick": 8.33, "total Mahony": 6.33},
    "31_disturbed_stationary_magnet_D": {"total Madgwick": 3.49, "total Mahony": 6.33},
    "33_disturbed_attached_magnet_2cm": {"total Madgwick": 7.09, "total Mahony": 10.96},
}

# Kortier, thesis ch. 2: tip of the index finger against an optical system (Table 2.2), distance of the tips in a pinch (2.3.2), mm
KORTIER_TIP: Mapping[str, Mapping[str, float]] = {
    "brisk flexion": {"x": 2.2, "y": 2.0, "z": 3.3, "tip": 5.0},
    "brisk circles": {"x": 5.7, "y": 4.9, "z": 9.7, "tip": 12.4},
    "pinch": {"tip": 6.5},
}
# Table 2.3: mean range and SD of all joint angles, deg
KORTIER_REPEATABILITY: Mapping[str, Mapping[str, float]] = {
    "flat hand": {"range": 1.1, "SD": 0.4},
    "clenched mould": {"range": 1.8, "SD": 0.6},
}
# Kortier, thesis ch. 3: medians of three subjects; dRMS in deg and mm, the gyroscopes' in % of maximum
KORTIER_TASKS: Mapping[str, float] = {
    "ab/adduction (14)": 3.3,
    "fast PIP": 7.7,
    "amplitude": 15.8,
    "amplitude's range": 10.4,
    "consistency": 7.0,
}
# Kortier's thesis, ch. 4: error of distances and lengths, mean and SD of 15 trials, %; gyroscopes' biases
KORTIER_FINGER: Mapping[str, tuple[float, float]] = {
    "distance, hand": (0.8, 2.0),
    "distance, proximal": (-0.4, 7.0),
    "distance, middle": (0.0, 4.3),
    "distance, distal": (-1.4, 3.4),
    "length, proximal": (-1.7, 4.8),
    "length, middle": (0.8, 4.1),
    "gyr bias": (-2.1, 22.4),
}

# Kortier, thesis ch. 5 (5.3, 5.4): four magnetometers, RMS in mm and deg, time below 0.5 dB in %; mean and SD of five trials. The summary's 19.4 mm is
# 19.7 in the chapter's abstract
KORTIER_MAGNET: Mapping[str, Mapping[str, tuple[float, float]]] = {
    "hand": {"position": (19.6, 4.6), "quiet": (50.1, 10.0)},
    "trunk": {"quiet": (0.1, 0.0)},
    "both": {
        "position": (19.4, 2.2),
        "relative": (2.3, 0.9),
        "trunk": (8.6, 8.7),
        "quiet": (8.6, 8.7),
    },
}
QUIET = 0.5  # dB, the thesis' limit of a signal

# Kortier, thesis ch. 6 (6.3): error of mass and stiffness, mean and SD of ten trials, %
KORTIER_OBJECTS: Mapping[str, tuple[float, float]] = {
    "0.28 kg": (19.7, 10.6),
    "0.44 kg": (29.3, 18.9),
    "0.6 N/mm": (14.8, 9.6),
}

"""The error-state Kalman filter of the fingers (Kortier, thesis, chapter 2).

samples, sample_alignment          samples of a chain's four sensors on one time base
chain_state, kernel_params         state and options as the compiled kernels take them
sensor_to_segment                  joints and their covariance after the initial pose
pose_error                         what the pose was missed by, and which joints were bent in it
preintegration                     propagation of state and covariance: (2.3)-(2.5), (2.17), (2.20)-(2.22)
measurements                       shared vertical (2.25)-(2.28); joint constraints (2.29)-(2.32)
magnetic_heading                   heading by the field of hand and fingertip: (2.24)-(2.27)
zero_rate_update, mean_rest        gyroscope biases of sensors at rest, also of a hand that trembles
inclination_noise, joint_compliance  errors of the vertical and of joints, learnt from the recording
mounting_change                    a sensor that has turned on its segment
between_chains                     what the fingers' chains learn of the hand's sensor, for thumb and wrist
joint_acceleration                 heading of the thumb by the acceleration that it shares with the hand
update_kernels, filter             one update: (2.15), (2.16)
output_covariance                  standard deviations of joint angles and fingertips

docs/methods/ekf.md has equation -> function -> test.
"""

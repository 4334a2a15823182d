/** Values of the HTTP API, written by `make types` from its OpenAPI description. */

/** What an administrator may change of an account; `version` is that which was read. */
export interface AccountChange {
  version: number;
  roles?: string[] | null;
  disabled?: boolean | null;
  wards?: number[] | null;
  heads?: number[] | null;
}

/** An account; nothing secret. */
export interface AccountRow {
  id: number;
  name: string;
  roles: string[];
  disabled: boolean;
  created: string;
  wards: MembershipRow[];
  proof: string;
  local: boolean;
  version: number;
  second?: boolean;
  code?: string;
  lacks_second_factor?: boolean;
}

/** How far a camera's angle is from the result's, deg: a difference is camera less result. */
export interface AngleAgreement {
  what: string;
  drms: number;
  offset: number;
  drms_minus_offset: number;
  rom_a: number;
  rom_b: number;
  drom: number;
  correlation: number | null;
  unit: string;
}

/** An angle of both, deg, on the recording's clock; null where unknown. */
export interface AngleCurve {
  what: string;
  t: (number | null)[];
  a: (number | null)[];
  b: (number | null)[];
  difference: (number | null)[];
}

/** The first code of an authenticator app. */
export interface AppCode {
  code: string;
}

/** Results that another one is to be compared with; null: nothing. */
export interface Choice {
  before?: number | null;
  other?: number | null;
}

/** How a camera's clock stands against the recording's: the recording's time is the camera's plus `seconds`. */
export interface ClockLag {
  seconds: number;
  correlation: number;
  overlap: number;
  rival: number | null;
  ppm: number | null;
}

/** The password again, before second factors change. */
export interface Confirmed {
  password: string;
}

/** A correction of a recording's event; times in s. */
export interface CorrectionRow {
  id: number;
  event: number;
  kind: string;
  onset: number;
  end: number;
  reason: string;
  reason_code: string;
  made: string;
  undone: string | null;
}

/** What a session takes over of a stored self-calibration. */
export interface Decision {
  parts: string;
  self_calibration?: number | null;
}

/** An emergency access to a patient of another ward. */
export interface EmergencyRow {
  id: number;
  patient: number;
  pseudonym: string;
  by: string;
  reason: string;
  begun: string;
  ends: string;
  lasts: boolean;
}

/** The pseudonym typed again, before everything of a patient is erased. */
export interface Erasure {
  pseudonym: string;
}

/** The range that a figure is to reach. */
export interface GoalRow {
  id: number;
  unit: string;
  low: number;
  high: number;
  changed: string;
}

/** A result beside a camera's hand landmarks. */
export interface LandmarkAnswer {
  name: string;
  frames: number;
  seen: number;
  lag: ClockLag;
  stretches: StretchAgreement[];
  curves: AngleCurve[];
}

/** A passkey as the browser made it. */
export interface MadePasskey {
  ticket: string;
  name: string;
  credential: Record<string, any>;
}

/** The photograph whose angles the next pose has. */
export interface MeasuredPose {
  photograph: number | null;
}

/** A ward that an account belongs to. */
export interface MembershipRow {
  ward: number;
  name: string;
  head: boolean;
}

/** The name of a ward. */
export interface NamedWard {
  name: string;
}

/** A new account: its name and its roles. */
export interface NewAccount {
  name: string;
  roles: string[];
  wards?: number[] | null;
}

/** An event of a recording corrected: its kind and interval, s. */
export interface NewCorrection {
  event: number;
  kind: string;
  reason?: string;
  reason_code?: "" | "helped" | "wrong" | "interrupted" | "slipped" | "pain";
  onset?: number;
  end?: number;
}

/** Whose data are needed, and why. */
export interface NewEmergencyAccess {
  pseudonym: string;
  reason: string;
}

/** A pose or a task of the recording, s from the first row. */
export interface NewEvent {
  trial_type: "initial_pose" | "flat_hand" | "task";
  onset: number;
  duration: number;
  task?: string;
}

/** A second factor to be added, with its name. */
export interface NewFactor {
  password: string;
  name: string;
}

/** The range that a figure is to reach, in the unit in which progress shows it. */
export interface NewGoal {
  hand: "left" | "right";
  measure: string;
  task: string;
  name: string;
  unit: string;
  low: number;
  high: number;
}

/** The text of a new note. */
export interface NewNote {
  text: string;
}

/** A new password, with the current one as proof. */
export interface NewPassword {
  current?: string;
  password: string;
}

/** A new patient, under a pseudonym. */
export interface NewPatient {
  pseudonym: string;
  ward?: number | null;
  year_of_birth?: number | null;
  dominant_hand?: string | null;
  affected_hand?: string | null;
  note?: string;
  confirmed?: boolean;
}

/** A plan's content as its file holds it; what it says of its version is not looked at. */
export interface NewPlan {
  content: Record<string, any>;
  seen?: number;
}

/** A recording processed anew: by which method, with which options. */
export interface NewResult {
  method?: string | null;
  options?: Record<string, any>;
}

/** A screen to be invited, and the language that its patient reads. */
export interface NewScreen {
  language?: string;
}

/** The result whose self-calibration is to be stored. */
export interface NewSelfCalibration {
  result: number;
}

/** A session to be started: hand, port, method with options, examiner. */
export interface NewSession {
  hand: string;
  port: string;
  method?: string;
  options?: Record<string, any>;
  examiner?: string;
  outlets?: string[];
  plan?: string;
  reuse?: Decision | null;
}

/** A live stream of poses to be opened. */
export interface NewStream {
  rate?: number;
}

/** A map, and what the patient did when. */
export interface NewTableRecording {
  map: Record<string, any>;
  events?: NewEvent[];
  events_tsv?: string;
  started?: string | null;
  method?: string | null;
}

/** What was done to a hand on a day. */
export interface NewTreatmentEvent {
  kind: "injury" | "operation" | "botulinum_toxin" | "splint" | "therapy" | "other";
  hand: "left" | "right" | "both";
  day: string;
  comment?: string;
}

/** A note's new text, or that it is removed. */
export interface NoteChange {
  version: number;
  text?: string | null;
  removed?: boolean | null;
}

/** A note on a patient. */
export interface NoteRow {
  id: number;
  text: string;
  written: string;
  removed: string | null;
  version: number;
}

/** How the other hand is measured; all else is as in the session that it follows. */
export interface OtherHand {
  port?: string;
  reuse?: Decision | null;
}

/** A patient with notes and sessions. */
export interface PatientAnswer {
  id: number;
  pseudonym: string;
  ward: number;
  ward_name: string;
  year_of_birth: number | null;
  dominant_hand: string | null;
  affected_hand: string | null;
  hand_measures: Record<string, any>;
  trunk_height: number | null;
  archived: boolean;
  created: string;
  version: number;
  notes: NoteRow[] | null;
  emergency_accesses: EmergencyRow[];
  sessions: Visit[];
  planned: number;
  clock: Record<string, any>;
}

/** What may change of a patient; `version` is that which was read. */
export interface PatientChange {
  version: number;
  pseudonym?: string | null;
  ward?: number | null;
  year_of_birth?: number | null;
  dominant_hand?: string | null;
  affected_hand?: string | null;
  hand_measures?: Record<string, Record<string, any>> | null;
  trunk_height?: number | null;
  archived?: boolean | null;
  confirmed?: boolean;
}

/** A patient in the list. */
export interface PatientListed {
  id: number;
  pseudonym: string;
  ward: number;
  ward_name: string;
  year_of_birth: number | null;
  dominant_hand: string | null;
  affected_hand: string | null;
  hand_measures: Record<string, any>;
  trunk_height: number | null;
  archived: boolean;
  created: string;
  version: number;
  sessions: number;
  planned: number;
  last_session: string | null;
}

/** A patient; lengths in m. */
export interface PatientRow {
  id: number;
  pseudonym: string;
  ward: number;
  ward_name: string;
  year_of_birth: number | null;
  dominant_hand: string | null;
  affected_hand: string | null;
  hand_measures: Record<string, any>;
  trunk_height: number | null;
  archived: boolean;
  created: string;
  version: number;
}

/** An assessment plan; `content` as its file holds it, Handscope's own in the reader's language. */
export interface PlanRow {
  name: string;
  version: number;
  title: string;
  content: Record<string, any>;
  own: boolean;
  author: string;
  stored: string | null;
}

/** What proves an account: a one-time token, or a name with its password. */
export interface Proof {
  token?: string;
  name?: string;
  password?: string;
}

/** A recording's file with its results. */
export interface RecordingRow {
  id: number;
  format: string;
  name: string;
  sha256: string | null;
  bytes: number;
  added: string;
  summary: Record<string, any>;
  corrections: CorrectionRow[];
  results: ResultRow[];
}

/** A result among those of its recording. */
export interface ResultRow {
  id: number;
  method: string;
  parameters: Record<string, any>;
  version: string;
  state: string;
  created: string;
  corrections: number;
  reused: Record<string, any>;
  current: boolean;
}

/** The code that opens a screen. */
export interface ScreenCode {
  code: string;
}

/** The second factor of a login: a code or a passkey's answer. */
export interface SecondProof {
  ticket: string;
  code?: string;
  credential?: Record<string, any> | null;
}

/** Whether a stored self-calibration is withdrawn. */
export interface SelfCalibrationChange {
  withdrawn: boolean;
}

/** A session with its recordings. */
export interface SessionAnswer {
  id: number;
  patient: any;
  hand: string;
  continues: number | null;
  state: string;
  started: string;
  dated: boolean;
  recorded_as: string | null;
  date_reason: string;
  trunk_height: number | null;
  trunk_corrected: boolean;
  version: number;
  finished: string | null;
  examiner: string;
  notes: string | null;
  conclusion: string | null;
  pain_rest: number | null;
  pain_movement: number | null;
  source: string;
  plan: Record<string, any>;
  duration: number | null;
  tasks: string[];
  empty: boolean;
  geometry: Record<string, any>;
  station: string | null;
  saving: boolean;
  other_hand: Record<string, any> | null;
  same_recording: Record<string, any>[];
  recordings: RecordingRow[];
}

/** What may change of a session; `version` is that which was read. */
export interface SessionChange {
  version: number;
  notes?: string | null;
  examiner?: string | null;
  conclusion?: string | null;
  pain_rest?: number | null;
  pain_movement?: number | null;
  started?: string | null;
  date_reason?: string;
  trunk_height?: number | null;
}

/** A session; duration in s, trunk height in m. */
export interface SessionRow {
  id: number;
  patient: any;
  hand: string;
  continues: number | null;
  state: string;
  started: string;
  dated: boolean;
  recorded_as: string | null;
  date_reason: string;
  trunk_height: number | null;
  trunk_corrected: boolean;
  version: number;
  finished: string | null;
  examiner: string;
  notes: string | null;
  conclusion: string | null;
  pain_rest: number | null;
  pain_movement: number | null;
  source: string;
  plan: Record<string, any>;
  duration: number | null;
  tasks: string[];
  empty: boolean;
}

/** What a person does at a station, with the details of that action. */
export interface StationAction {
  action: string;
  task?: string;
  reason?: string;
  group?: string;
  value?: number | null;
}

/** A station that runs. */
export interface StationRow {
  station: string;
  kind: string;
}

/** From which side the hand is to be seen; `fit` keeps the side. With `mirrored` the picture is mirrored or not, and the side stays. */
export interface StationView {
  side?: "own" | "front" | "back" | "thumb" | "little" | "palm" | "fit";
  mirrored?: boolean | null;
}

/** Joints that cannot be straightened. */
export interface StiffJoints {
  angles: Record<string, number>;
}

/** All angles in one stretch. */
export interface StretchAgreement {
  event: number | null;
  onset: number;
  end: number;
  angles: AngleAgreement[];
}

/** A table that is being mapped: its first rows and a guess of its columns. */
export interface TableAnswer {
  name: string;
  is_text: boolean;
  layout: Record<string, any>;
  names: string[];
  columns: number;
  count: number;
  rows: string[][];
  map: Record<string, any> | null;
  triads: TableTriad[];
  questions: string[];
  problem: string | null;
  choices: Record<string, any>;
  stored: Record<string, any> | null;
}

/** A finding about the numbers of a mapped table. */
export interface TableFinding {
  severity: string;
  text: string;
}

/** Duration, rate, rests and findings of a mapped table's numbers; s and Hz. */
export interface TableFindings {
  duration: number;
  rate: number;
  rests: number[][];
  findings: TableFinding[];
}

/** A map of the columns, as MAP.json has it (docs/devices.md). */
export interface TableMapping {
  map: Record<string, any>;
}

/** Columns of one quantity in the order of its components. */
export interface TableTriad {
  quantity: string;
  columns: (string | number)[];
  unit: string;
  point: string | null;
}

/** A login that waits for its second factor. */
export interface Ticket {
  ticket: string;
}

/** Segments of trackers. */
export interface TrackerPlaces {
  places: Record<string, string>;
}

/** What was done to a hand on a day. */
export interface TreatmentEventRow {
  id: number;
  kind: string;
  hand: string;
  day: string;
  comment: string;
}

/** A session among those of its patient. */
export interface Visit {
  id: number;
  patient: any;
  hand: string;
  continues: number | null;
  state: string;
  started: string;
  dated: boolean;
  recorded_as: string | null;
  date_reason: string;
  trunk_height: number | null;
  trunk_corrected: boolean;
  version: number;
  finished: string | null;
  examiner: string;
  notes: string | null;
  conclusion: string | null;
  pain_rest: number | null;
  pain_movement: number | null;
  source: string;
  plan: Record<string, any>;
  duration: number | null;
  tasks: string[];
  empty: boolean;
  calibration: Record<string, any> | null;
  warnings: number;
  doubts: string[];
}

/** A ward of the hospital. */
export interface WardRow {
  id: number;
  name: string;
  house: boolean;
  own: boolean;
}

"""Names of the roles that accounts have (clinic/accounts.py says what each may); without the database, for what only names them."""

CLINICIAN, SCIENTIST, ADMINISTRATOR = ROLES = ("clinician", "scientist", "administrator")

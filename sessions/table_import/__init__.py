"""Tables of other loggers as recordings.

tables          a file as columns of numbers; `formats` has makers' own formats
guess, triads   which columns probably are what
column_map      the map that a person has confirmed (MAP.json)
examine         rate, gaps, gravity and rest of the mapped numbers, as findings
convert         the mapped table as a recording; `importing` stores it
"""

"""What a recording shows: figures and pages for people who were not there."""

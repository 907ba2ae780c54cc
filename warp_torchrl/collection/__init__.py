"""Collection of experience: in this process or in workers, optionally with a teacher."""

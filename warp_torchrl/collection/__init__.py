"""How experience is collected: in this process, in others, with a teacher beside."""

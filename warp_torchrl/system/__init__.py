"""Access to the machine: files, processes, signals, memory, devices."""

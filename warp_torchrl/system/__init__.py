"""What is asked of the machine: files, processes, signals, memory, devices."""

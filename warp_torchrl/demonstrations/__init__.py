"""What people and policies did on fires: recorded, replayed exactly, and learned from.

``recording`` holds the steps of an episode, ``files`` keeps it in a folder, ``events`` are what people did to the
world, and ``replay`` plays all of it again.
"""

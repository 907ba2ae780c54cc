"""Live page: watch a team fight a fire in three dimensions, and drive its vehicles.

``match`` plays one fire, ``crew`` chooses each vehicle's action, ``drawing`` makes the arrays that are drawn; none of
them knows of a browser. ``page``, ``stage`` and the package ``panel`` put them on a page with viser (extra ``live``).
"""

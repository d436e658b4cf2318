"""QPs by a dual active-set method, compiled: a dual Schur-complement method.

`engine` has the pivots and the memory, `rounds` a whole solve and the refined point,
`dense` and `sparse` the operators, `null` another form for most variables at bounds.
`solve` is the door.
"""

"""Many QPs alike: sequences, small calls, batches; ours beside the others.

==========  ============================================================================
sequences   the same matrices again and again, each solver by its own workspace
latency     a single dense QP of n = 2 to 1000 variables, by calls
batches     many small QPs at once: throughput against threads and size of the batch
workspaces  setup, update and solve of every solver
front_figure  that of the front page
==========  ============================================================================
"""

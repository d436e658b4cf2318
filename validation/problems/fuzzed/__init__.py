"""The fuzzed problems of the campaign: QPs and LCPs with what is true of them.

draw: random matrices and vectors. qps, lcps: the classes of problems. forms: the
representations in which arguments are passed, right and malformed. cases: problem i.
"""

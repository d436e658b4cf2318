"""Many QPs alike: sequences, small calls, batches; ours beside the others."""

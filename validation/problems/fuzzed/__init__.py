"""The fuzzed problems of the campaign: QPs and LCPs with what is true of them."""

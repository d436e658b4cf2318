"""Box LCPs: checked, solved by the method that fits or is asked for, judged."""

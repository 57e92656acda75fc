"""The paper's tables, flown again and set side by side with what the paper reports."""

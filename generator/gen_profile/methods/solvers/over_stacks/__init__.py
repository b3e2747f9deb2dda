"""Trolley and hoist together over what stands there: the hoist in closed form, the trolley by programs."""

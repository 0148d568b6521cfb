"""A gear pair without equations of motion: static contact of all pairs of teeth, heard through a linear structure.

The transmission error under load is solved at each instant from the tooth pairs' stiffness and separations, then drives
drawn modes, as do forces of shafts, friction and bearings beside it. It has its own shapes of stiffness, deviations and
effects, many of them drawn anew for each machine, so that whoever learns from it learns what they have in common.

Not represented: what a dynamic mesh force does back to the contact – parametric resonance, teeth that part (backlash).

Source: H. N. Özgüven, D. R. Houser, "Dynamic analysis of high speed gears by using loaded static transmission error",
J. Sound Vib. 125 (1988); W. D. Mark, "Analysis of the vibratory excitation of gear systems: basic theory", J. Acoust.
Soc. Am. 63 (1978).
"""

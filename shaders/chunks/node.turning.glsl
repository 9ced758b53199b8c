// Effect: bodies in contact that turn. Needs: node.contact.
// Gives: turn_of(obstacle, x): how much further than its point at the common point the obstacle goes at x in a step, mm.

/// `x` is a position from the common point; the spin, rad/s, lies behind the velocity.
vec3 turn_of(uint obstacle, vec3 x) { return time_step * cross(contact_vector(obstacle + 23u), x); }

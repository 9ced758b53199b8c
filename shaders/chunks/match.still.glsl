// Gives: no displacement: the wide grid lies in the fixed image's frame. In the place of match.field.
// Needs: match.

vec3 field_at(uint offset) { return vec3(0.0); }

// Gives: the binding of every storage block. The passes of a step use different numbers, so that one binding serves a
// whole run; at most 24, which every driver of OpenGL 4.5 that is known to us offers. The host asks the linked program
// for its blocks and never repeats these numbers.

#define BINDING_DISPLACEMENT 0         // mm, xyz of node
#define BINDING_INCREMENT 1            // u - u⁻, mm, xyz of node
#define BINDING_INVERSE_MASS 2         // xyz of node, zero where constrained
#define BINDING_ELEMENT_NODES 3
#define BINDING_ELEMENT_REST 4
#define BINDING_CORNER_FORCE 5         // mN
#define BINDING_NODE_INCIDENCE 6
#define BINDING_EXTERNAL_FORCE 7       // mN, xyz of node
#define BINDING_SPRINGS 8
#define BINDING_RESIDUAL 10            // mN, xyz of node, zero where constrained
#define BINDING_VOLUME_CHANGE 11
#define BINDING_PRESSURE 12            // kPa
#define BINDING_PRESSURE_CORNERS 13
#define BINDING_PRESSURE_REST 14
#define BINDING_PRESSURE_INCIDENCE 15
#define BINDING_MATERIAL_PARAMETERS 16 // kPa and exponents
#define BINDING_FIBRE 17               // unit vector of element
#define BINDING_PRONY 18
#define BINDING_VISCOUS_STRESS 19      // kPa
#define BINDING_SURFACE_EFFECTS 20
#define BINDING_SURFACE_FORCE 21       // mN, xyz of node
#define BINDING_FLUID 22
#define BINDING_CONTACT 23

// Steps over patches, whose programs share materials and the effects on nodes with the others.
#define BINDING_PATCH_HEAD 3
#define BINDING_PATCH_REST 4
#define BINDING_PATCH_STATE 5
#define BINDING_PATCH_FORCES 6
#define BINDING_PATCH_SOURCES 10
#define BINDING_PATCH_LARGEST 12
#define BINDING_PATCH_NEIGHBOURS 13
#define BINDING_PATCH_PROGRESS 14
#define BINDING_PATCH_NODE 15
#define BINDING_PATCH_VOLUMES 17
#define BINDING_PATCH_SLOT 18
#define BINDING_PATCH_TISSUE 20
#define BINDING_PATCH_ELEMENT 21

// Outside of a step, these take the place of blocks that the kernel at hand does not use.
#define BINDING_PARTIAL 6
#define BINDING_PREVIOUS_RESIDUAL 7
#define BINDING_PREVIOUS_DISPLACEMENT 8
#define BINDING_IMPOSED 9

// Measuring the device's ceilings.
#define BINDING_COPY_SOURCE 0
#define BINDING_COPY_TARGET 1

// Completes the parameters of a mesh from its volume alone.
#pragma once

#include "proto/types.h"

namespace isomesh::jobs {

// Replaces the name of a preset by its value. Throws Error kInvalidParameter, which lists the
// volume's presets, if it has none with that name.
void resolve_preset(MeshParameters& parameters, const Volume& volume);

// Throws Error kUnusableVolume if an axis has fewer than two samples, as labels need.
void check_has_cells(const Volume& volume);

// Sets the displacement limit of Laplacian and Taubin smoothing of labels, half the smallest
// spacing, unless the parameters have one.
void limit_displacement(const Volume& volume, MeshParameters& parameters);

}  // namespace isomesh::jobs

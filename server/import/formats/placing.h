// Geometries of formats that have RAS coordinates, or no patient at all.
#pragma once

#include <array>
#include <cstdint>
#include <string>

#include "proto/notes.h"
#include "server/import/source/names.h"

namespace isomesh::import {

// The LPS geometry of a sample (0,0,0) and of steps that are in RAS, in millimetres.
Geometry geometry_of_ras(const Vector3& origin, const std::array<Vector3, 3>& steps);

// Throws Error kUnusableVolume for sizes of values on a surface, as FreeSurfer keeps them in MGH
// and NIfTI: all in one row, or those of its average brain as N x 1 x M.
void check_is_lattice(const std::array<std::uint32_t, 3>& dims);

// For a format that says nothing of a patient: its coordinates are read as LPS.
Note lps_assumed(const std::string& format);

// For coordinates that stay in angstrom.
Note angstrom_note(const std::string& format);

}  // namespace isomesh::import

// Jobs of synthetic volumes, and isomesh-verify's word on them.
#pragma once

#include <string>

#include "client/verify/verify.h"
#include "proto/parameters.h"
#include "tests/support/shapes.h"

namespace isomesh::test {

struct Made {
  std::string file;
  bool is_proven = false;  // the job says that the distance holds
};

// A job's only file, and its word on it. Vertices are not moved before they are simplified, unless
// `parameters` say so.
Made made_with_word(const SampleVolume<float>& volume, const MeshParameters& parameters);
std::string made(const SampleVolume<float>& volume, const MeshParameters& parameters);

// An iso-value of 0, STL, max_error_mm.
MeshParameters parameters_within(double bound);

verify::Field field_of(const SampleVolume<float>& volume);

// The answer for a mesh of a job with those parameters, within their max_error_mm; without one, of
// the surface as it is extracted.
verify::Verdict verdict(verify::Surface mesh, const SampleVolume<float>& volume,
                        const MeshParameters& parameters);

// Two balls, one of them hollow, in steps of half a millimetre.
SampleVolume<float> balls();

// A binary STL file.
std::string stl_of(const verify::Surface& surface);

}  // namespace isomesh::test

// Units of length that headers give in words.
#pragma once

#include <optional>
#include <string_view>

#include "server/import/source/source.h"

namespace isomesh::import {

// The length of a unit of the SI, or of another one that OME-Zarr and OME-XML list, by its symbol
// or its name in singular or plural ("um", "micrometer", "inches"). The case of letters matters
// only for symbols that differ in nothing else, such as Mm. Empty for every other text.
std::optional<double> millimetres_of(std::string_view unit);

// True for a unit that says nothing: no text, or the placeholder of some writers.
bool is_no_unit(std::string_view unit);

// The factor that makes millimetres of lengths in a header's unit: 1 if there is none, and for one
// that is no known length, which goes into `volume`. One that counts samples ("pixel") is assumed
// to be a millimetre.
double take_unit(std::string_view unit, SourceVolume& volume);

// Scales the volume's origin and spacing by the factor of take_unit().
void scale_to_millimetres(std::string_view unit, SourceVolume& volume);

}  // namespace isomesh::import

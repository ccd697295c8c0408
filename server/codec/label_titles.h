// Names and colours of labels in files.
#pragma once

#include <array>
#include <set>
#include <string>

#include "proto/types.h"

namespace isomesh::codec {

// A label's name in files; "label 3" if it has none.
std::string title_of(const LabelSummary& label);

// Its colour: red, green and blue from 0 to 1, in sRGB. Without a colour of its own, a fixed series
// determines it from the label's value.
std::array<double, 3> color_of(const LabelSummary& label);

// A channel in linear light, as glTF and USD want it (IEC 61966-2-1).
double linear_of(double srgb);

// Names the groups of an OBJ: a label's title with blanks replaced; equal titles get the label's
// value appended. Names follow from the order of the calls: all labels, ascending.
class ObjGroups {
 public:
  std::string of(const LabelSummary& label);

 private:
  std::set<std::string> taken_;
};

// A label's material in an MTL file: its diffuse colour, in sRGB as programs that write MTL do.
std::string mtl_material(const std::string& group, const LabelSummary& label);

}  // namespace isomesh::codec

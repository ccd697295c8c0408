// Small HDF5 files, written by the library.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace isomesh::import::test {

struct Hdf5Image {
  std::vector<std::int16_t> samples;
  bool is_chunked = true;  // and compressed
};

// An image of ITK of 4 x 3 x 2 samples, 1, 2 and 3 mm apart at (5, 6, 7); its first axis runs along
// -y, its second along x.
std::string itk_hdf5(const Hdf5Image& image);

struct MincFields {
  std::string order = "zspace,yspace,xspace";
  std::vector<std::uint64_t> sizes = {2, 3, 4};
  std::vector<double> valid_range = {-100, 100};
  std::vector<double> least = {-10, 0};  // of the real values of each slice, or of all
  std::vector<double> most = {10, 200};
  std::string units = {};  // of all three axes
};

// x has steps of -1 from 5, y of 2 from 6, z of 3 from 7.
std::string minc(const MincFields& fields, const Hdf5Image& image);

// A file with the groups of Imaris.
std::string imaris();

}  // namespace isomesh::import::test

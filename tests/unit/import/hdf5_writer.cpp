#include "tests/unit/import/hdf5_writer.h"

#include <stdexcept>

#include <hdf5.h>

#include "tests/unit/import/files.h"

namespace isomesh::import::test {
namespace {

// Everything that is opened stays open until the file is closed.
class Writer {
 public:
  Writer() : path_(folder_.path("file.h5")) {
    const hid_t access = H5Pcreate(H5P_FILE_ACCESS);
    H5Pset_fclose_degree(access, H5F_CLOSE_STRONG);
    file_ = H5Fcreate(path_.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, access);
    if (file_ < 0) throw std::runtime_error("H5Fcreate failed");
  }

  std::string finish() {
    H5Fclose(file_);
    return read_file(path_);
  }

  void group(const std::string& path) {
    H5Gcreate2(file_, path.c_str(), H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
  }

  void numbers(const std::string& path, const std::vector<hsize_t>& sizes,
               const std::vector<double>& values) {
    const hid_t set = create(path, sizes, H5T_IEEE_F64LE, H5P_DEFAULT);
    H5Dwrite(set, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data());
  }

  hid_t image(const std::string& path, const std::vector<hsize_t>& sizes, const Hdf5Image& image) {
    const hid_t list = H5Pcreate(H5P_DATASET_CREATE);
    if (image.is_chunked) {
      std::vector<hsize_t> chunk = sizes;
      chunk.back() = 3;
      chunk.front() = 1;
      H5Pset_chunk(list, static_cast<int>(chunk.size()), chunk.data());
      H5Pset_shuffle(list);
      H5Pset_deflate(list, 4);
    }
    const hid_t set = create(path, sizes, H5T_STD_I16BE, list);
    H5Dwrite(set, H5T_NATIVE_INT16, H5S_ALL, H5S_ALL, H5P_DEFAULT, image.samples.data());
    return set;
  }

  hid_t group_with(const std::string& path) {
    group(path);
    return H5Oopen(file_, path.c_str(), H5P_DEFAULT);
  }

  static void attribute(hid_t object, const std::string& name, const std::vector<double>& values) {
    const hsize_t count = values.size();
    const hid_t space = H5Screate_simple(1, &count, nullptr);
    const hid_t made =
        H5Acreate2(object, name.c_str(), H5T_IEEE_F64LE, space, H5P_DEFAULT, H5P_DEFAULT);
    H5Awrite(made, H5T_NATIVE_DOUBLE, values.data());
  }

  static void attribute(hid_t object, const std::string& name, const std::string& text) {
    const hid_t type = H5Tcopy(H5T_C_S1);
    H5Tset_size(type, text.size() + 1);
    const hid_t made =
        H5Acreate2(object, name.c_str(), type, H5Screate(H5S_SCALAR), H5P_DEFAULT, H5P_DEFAULT);
    H5Awrite(made, type, text.c_str());
  }

 private:
  hid_t create(const std::string& path, const std::vector<hsize_t>& sizes, hid_t type, hid_t list) {
    const hid_t space = H5Screate_simple(static_cast<int>(sizes.size()), sizes.data(), nullptr);
    return H5Dcreate2(file_, path.c_str(), type, space, H5P_DEFAULT, list, H5P_DEFAULT);
  }

  Folder folder_;
  std::string path_;
  hid_t file_ = -1;
};

}  // namespace

std::string itk_hdf5(const Hdf5Image& image) {
  Writer writer;
  writer.group("ITKImage");
  writer.group("ITKImage/0");
  writer.numbers("ITKImage/0/Dimension", {3}, {4, 3, 2});
  writer.numbers("ITKImage/0/Origin", {3}, {5, 6, 7});
  writer.numbers("ITKImage/0/Spacing", {3}, {1, 2, 3});
  writer.numbers("ITKImage/0/Directions", {3, 3}, {0, -1, 0, 1, 0, 0, 0, 0, 1});
  writer.image("ITKImage/0/VoxelData", {2, 3, 4}, image);
  return writer.finish();
}

std::string minc(const MincFields& fields, const Hdf5Image& image) {
  Writer writer;
  for (const char* group :
       {"minc-2.0", "minc-2.0/image", "minc-2.0/image/0", "minc-2.0/dimensions"}) {
    writer.group(group);
  }
  const std::vector<std::pair<std::string, std::vector<double>>> axes = {
      {"xspace", {5, -1}}, {"yspace", {6, 2}}, {"zspace", {7, 3}}};
  for (const auto& [name, start_and_step] : axes) {
    const hid_t axis = writer.group_with("minc-2.0/dimensions/" + name);
    Writer::attribute(axis, "start", std::vector{start_and_step[0]});
    Writer::attribute(axis, "step", std::vector{start_and_step[1]});
    if (!fields.units.empty()) Writer::attribute(axis, "units", fields.units);
  }
  const std::string place = "minc-2.0/image/0/";
  const hid_t set =
      writer.image(place + "image", {fields.sizes.begin(), fields.sizes.end()}, image);
  Writer::attribute(set, "dimorder", fields.order);
  Writer::attribute(set, "valid_range", fields.valid_range);
  writer.numbers(place + "image-min", {fields.least.size()}, fields.least);
  writer.numbers(place + "image-max", {fields.most.size()}, fields.most);
  return writer.finish();
}

std::string imaris() {
  Writer writer;
  writer.group("DataSet");
  writer.group("DataSetInfo");
  return writer.finish();
}

}  // namespace isomesh::import::test

// Volumes of pictures: a TIFF of several pages, or several files of one page each.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "server/import/source/reader.h"

namespace isomesh::import {

struct ImageFile {
  std::string name;
  std::filesystem::path path;
};

// True for a TIFF of several pages, which is a volume of its own.
bool has_pages(const std::filesystem::path& path);

// Reads one TIFF of several pages, or files of one page in the natural order of their names. x runs
// along rows, y down the columns, z from file to file. The spacing is that of OME-TIFF or ImageJ;
// other files have none. Writes the task's target. Throws as import_volume does, also for a missing
// number between the names.
Volume import_images(std::vector<ImageFile> files, const ImportTask& task);

// A file that was uploaded alone.
Volume parse_image(const Input& input);

// Of any picture; its header does not bound its size.
MostBytes most_image_bytes(const InputFile& beginning, const ImportTask& task);

}  // namespace isomesh::import

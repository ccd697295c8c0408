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

// Reads one TIFF of several pages, or files of one page in the order of the numbers in their names.
// x runs along rows, y down the columns, z from file to file. The spacing is that of OME-TIFF,
// ImageJ or SCIFIO; other files have none. Writes the task's target. Throws as import_volume does,
// also for a missing number between the names, or names that allow several orders.
Volume import_images(std::vector<ImageFile> files, const ImportTask& task);

// A file that was uploaded alone.
Volume parse_image(const Input& input);

// The limit for all pictures: their headers do not bound their size.
MostBytes most_image_bytes(const InputFile& beginning, const ImportTask& task);

}  // namespace isomesh::import

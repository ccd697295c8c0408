// TIFF images of grey samples or indices
// (https://www.itu.int/itudoc/itu-t/com16/tiff-fx/docs/tiff6.pdf), also BigTIFF.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

#include "base/files.h"
#include "server/import/images/page.h"
#include "server/import/images/tiff_meaning.h"

namespace isomesh::import {

bool is_tiff(std::string_view head);

class TiffFile {
 public:
  // Throws Error kUnusableVolume if the file is damaged or has more than a million pages.
  explicit TiffFile(const InputFile& file);
  ~TiffFile();
  TiffFile(const TiffFile&) = delete;
  TiffFile& operator=(const TiffFile&) = delete;

  // The number of pages, without reduced copies of others, or of ImageJ's planes behind a single
  // page.
  std::uint64_t pages();

  // The meaning of these pages.
  TiffMeaning meaning();

  // Reads a page below pages(), from its top left. Stored samples are not inverted if 0 is white.
  // Throws Error kUnusableVolume, also for colours without a palette and lossy compression.
  void read(std::uint64_t page, const PageCheck& check, const PageSink& sink);

 private:
  class Library;
  std::unique_ptr<Library> library_;
};

}  // namespace isomesh::import

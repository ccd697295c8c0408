#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmdata/dcostrma.h>

#include "base/descriptor.h"

namespace isomesh::association {

// Continues after write errors, so that the rest of the object is read from the connection and the
// sender gets a status. DCMTK's own file output would end the association.
class FileSink : public DcmConsumer {
 public:
  // Writes at most that many bytes.
  FileSink(const std::filesystem::path& path, std::uint64_t most_bytes);

  bool has_failed() const { return has_failed_; }

  OFBool good() const override { return OFTrue; }
  OFCondition status() const override { return EC_Normal; }
  OFBool isFlushed() const override { return OFTrue; }
  offile_off_t avail() const override { return kPieceBytes; }
  offile_off_t write(const void* bytes, offile_off_t count) override;
  void flush() override {}

 private:
  static constexpr offile_off_t kPieceBytes = 1 << 20;

  Descriptor file_;
  std::uint64_t room_;
  bool has_failed_ = false;
};

// A stream of DCMTK that writes to a FileSink.
class FileStream : public DcmOutputStream {
 public:
  explicit FileStream(FileSink& sink) : DcmOutputStream(&sink) {}
};

}  // namespace isomesh::association

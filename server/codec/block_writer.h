// Writes a file's records in bounded memory. Private to this folder.
#pragma once

#include <cstddef>
#include <functional>
#include <vector>

#include "server/codec/encode.h"

namespace isomesh::codec {

// Formats blocks of records on several threads and writes their bytes in order. Holds one block per
// thread. Not thread safe.
class BlockWriter {
 public:
  // `records` is the total over all calls of write, for the progress.
  BlockWriter(const mesh::Context& context, const Sink& sink, std::size_t records)
      : context_(context), sink_(sink), records_(records) {}

  // Writes the records [0, count). one_record(index, out) formats one at `out` and returns its end,
  // at most `most_bytes` behind; several threads call it. Throws Error kCancelled, checked before
  // each block.
  template <class OneRecord>
  void write(std::size_t count, std::size_t most_bytes, OneRecord one_record) {
    write_blocks(count, most_bytes, [&](std::size_t begin, std::size_t end, std::byte* out) {
      for (std::size_t index = begin; index < end; ++index) out = one_record(index, out);
      return out;
    });
  }

 private:
  using FormatRun = std::function<std::byte*(std::size_t begin, std::size_t end, std::byte* out)>;

  struct Block {
    std::vector<std::byte> bytes;
    std::size_t used = 0;
  };

  void write_blocks(std::size_t count, std::size_t most_bytes, const FormatRun& format);

  const mesh::Context& context_;
  const Sink& sink_;
  const std::size_t records_;
  std::size_t done_ = 0;
  std::vector<Block> blocks_;
};

}  // namespace isomesh::codec

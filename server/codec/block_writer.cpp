#include "server/codec/block_writer.h"

#include <algorithm>
#include <span>

#include "server/mesh/parallel.h"

namespace isomesh::codec {
namespace {

constexpr std::size_t kRecordsPerBlock = 8192;

}  // namespace

void BlockWriter::write_blocks(std::size_t count, std::size_t most_bytes, const FormatRun& format) {
  const auto threads = static_cast<std::size_t>(mesh::thread_count());
  const mesh::Context quiet = {context_.stop, nullptr};
  for (std::size_t wave = 0; wave < count; wave += threads * kRecordsPerBlock) {
    const std::size_t blocks =
        std::min(threads, (count - wave + kRecordsPerBlock - 1) / kRecordsPerBlock);
    if (blocks_.size() < blocks) blocks_.resize(blocks);
    mesh::parallel_for(quiet, blocks, [&](std::size_t i) {
      const std::size_t begin = wave + i * kRecordsPerBlock;
      const std::size_t end = std::min(count, begin + kRecordsPerBlock);
      Block& block = blocks_[i];
      if (block.bytes.size() < kRecordsPerBlock * most_bytes) {
        block.bytes.resize(kRecordsPerBlock * most_bytes);
      }
      std::byte* const first = block.bytes.data();
      block.used = static_cast<std::size_t>(format(begin, end, first) - first);
    });
    for (std::size_t i = 0; i < blocks; ++i) {
      sink_(std::span(blocks_[i].bytes).first(blocks_[i].used));
    }
    done_ += std::min(count - wave, threads * kRecordsPerBlock);
    if (context_.progress) {
      context_.progress(static_cast<double>(done_) / static_cast<double>(records_));
    }
  }
}

}  // namespace isomesh::codec

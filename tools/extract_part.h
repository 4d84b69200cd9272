#pragma once

#include "ranks/ranks.h"
#include "tools/extract_plan.h"

namespace isobrick::tools {

/// The extension of pieces of meshes.
inline constexpr std::string_view kPieceExtension = ".piece";

/// `isobrick extract --part`: a piece of each isosurface.
int run_extract_part(const ExtractArguments& given, Console& console);

/// Refuses options of what only the whole mesh becomes.
void check_part_arguments(const ExtractArguments& arguments);

/// How many pieces a mesh of so many active blocks is made of. Without ranks by the mesh alone, so
/// that the next run finds the same parts.
std::uint32_t count_pieces(std::uint64_t active_blocks, const Ranks* job, bool on_device = false);

/// Makes the folder of pieces, which may be there.
void create_piece_folder(const std::filesystem::path& folder);
/// Removes it if nobody put anything else into it. An empty path: none.
void remove_piece_folder(const std::filesystem::path& folder);

/// Opens the input. The first rank of a job adds what a store lacks before the others open it.
OpenedVolume open_shared_input(const ExtractArguments& arguments, Ranks* job, Console& console,
                               std::optional<Downsampling> downsampling = {});

/// Refuses what is not made by way of pieces; `reason` is why the mesh is.
void check_piece_arguments(const ExtractArguments& arguments, std::string_view reason);

/// Makes each mesh by way of pieces that several devices share, as the ranks of a job do.
CommandOutput make_on_devices(const ExtractArguments& arguments,
                              const std::vector<ExtractedSurface>& surfaces,
                              const StoreReader& store, Console& console);

/// Of the ranks on a machine each takes a device of its own, as long as there are enough.
void choose_device(const Ranks& job, ExtractArguments& arguments);

/// Makes each mesh by way of pieces in a folder beside it, which goes once the mesh is there: for
/// --resume, and for the ranks of a job, where `job` is not null. The pieces that are there are
/// kept.
CommandOutput make_by_pieces(const ExtractArguments& arguments,
                             const std::vector<ExtractedSurface>& surfaces,
                             const StoreReader& store, Ranks* job, Console& console);

}  // namespace isobrick::tools

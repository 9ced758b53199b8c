#pragma once
/// How a hidden folder of results takes the place of older ones, in steps that another process can finish.

#include "apps/output_folder.hpp"

namespace tissuewarp::apps {

/// The hidden folders of one run, by the number of its process: written to, complete, complete with the old results
/// out of the way; and these.
struct HiddenFolders {
    std::filesystem::path partial, complete, ready, old;
};
HiddenFolders hidden_folders(const std::filesystem::path& folder, const std::string& run);

/// Finishes what stands in `complete` or `ready`: old results move to `old`, new ones to their places, and both hidden
/// folders go. Does nothing where there is neither. Throws IoError.
void finish_commit(const std::filesystem::path& folder, const std::string& run, const IsResult& is_result);

/// Finishes commits and removes hidden folders of runs that live no more, as the locks on them tell.
void sweep(const std::filesystem::path& folder, const IsResult& is_result);

/// An open, locked descriptor of a folder; -1 where another process holds the lock. It is freed when it is closed.
int lock_folder(const std::filesystem::path& folder);

}  // namespace tissuewarp::apps

"""Kernels are optimised once, within the entry that they end in.

Left to itself numba optimises every function that is called from another one on its own, down to machine
code, with all that it calls: through ten levels of kernels most of it ten times. Here a kernel only becomes
code that can be linked. The library of an entry links the kernels below it, all of them once, and is
optimised as a whole. Nobody else can call what it links, so that what is called from one place is taken in
there, and what is not used is neither handed over nor kept.
"""

from __future__ import annotations

from typing import Any

from llvmlite import binding
from numba import _dynfunc
from numba.core import compiler, config, typed_passes
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler_machinery import register_pass


class _KernelLibrary(JITCodeLibrary):
    """Code of a kernel, to be linked; it never runs from here."""

    def add_linking_library(self, library: Any) -> None:
        self._linking_libraries.append(library)

    def finalize(self) -> None:
        self._raise_if_finalized()
        self._finalized = True


class _EntryLibrary(JITCodeLibrary):
    """Code of an entry with all kernels below it."""

    def add_linking_library(self, library: Any) -> None:
        waiting, seen = [library], set(self._linking_libraries)
        while waiting:
            found = waiting.pop()
            if found not in seen:
                seen.add(found)
                super().add_linking_library(found)
                if isinstance(found, _KernelLibrary):
                    waiting += found._linking_libraries

    def _optimize_final_module(self) -> None:
        """As numba does, but for kernels that are the entry's own, and with neighbours put into vectors."""
        for function in self._final_module.functions:
            if function.linkage == binding.Linkage.linkonce_odr and not function.is_declaration:
                function.linkage = binding.Linkage.internal
        cheap, by = self._codegen._module_pass_manager(loop_vectorize=False, opt=0, cost="cheap")
        cheap.run(self._final_module, by)
        # Vectors of Intel's library round otherwise than its plain functions do.
        vectors = not config.USING_SVML
        full, by = self._codegen._module_pass_manager(loop_vectorize=vectors, slp_vectorize=vectors)
        full.run(self._final_module, by)


@register_pass(mutates_CFG=True, analysis_only=False)
class _KernelLowering(typed_passes.NativeLowering):
    """Lowering that leaves out machine code: callers need nothing but a name to call a kernel by."""

    _name = "kernel_lowering"

    def run_pass(self, state: Any) -> bool:
        context = state.targetctx
        state.library = _KernelLibrary(context.codegen(), state.func_id.func_qualname)
        context.get_executable = _unlinked
        try:
            return bool(super().run_pass(state))
        finally:
            del context.get_executable


def _unlinked(library: Any, fndesc: Any, env: Any) -> Any:
    """Stands for the compiled function of a kernel, which nobody calls."""
    return _dynfunc.make_function(fndesc.lookup_module(), fndesc.qualname, "", 1, env, (library,))


class KernelCompiler(compiler.CompilerBase):
    """Pipeline of a kernel."""

    def define_pipelines(self) -> list[Any]:
        """The usual one with the lowering above."""
        manager = compiler.DefaultPassBuilder.define_nopython_pipeline(self.state)
        passes = [
            (_KernelLowering if each is typed_passes.NativeLowering else each, text)
            for each, text in manager.passes
        ]
        manager.passes = passes
        manager._finalized = False
        manager.finalize()
        return [manager]


class EntryCompiler(compiler.CompilerBase):
    """Pipeline of an entry."""

    def define_pipelines(self) -> list[Any]:
        """The usual one, into a library that links all kernels below."""
        codegen = self.state.targetctx.codegen()
        library = _EntryLibrary(codegen, self.state.func_id.func_qualname)
        library.enable_object_caching()
        self.state.library = library
        return [compiler.DefaultPassBuilder.define_nopython_pipeline(self.state)]

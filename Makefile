# make demo   sets everything up and annotates real photographs
# make test   lint, types and every test; those of training need PyTorch, see docs/dependencies.md
# make blender  the optional Blender renderer (GPL-3) in a virtualenv of its own; its tests run when it is there
# make ray  Ray Data for `annotate --executor ray`; its tests run when it is there
# make postgres  a PostgreSQL server of Debian's; the store's tests run on it too when it is there
# make browser  Chromium, three.js, the glTF validator and axe, for the tests of exported scenes and of the review page
# make detectors  what DetectoRS needs but for its weights (PyTorch among it); its tests run when it is there
# make web  builds the review page from web/ into src/cadpose/review/static, where it is committed; needs node 20.19
# make docs  the documentation as a site, runs/site/index.html; a broken link or anchor fails it
# make wheel  wheel and source distribution into dist/, tried in clean virtualenvs of each Python at hand (3.11-3.13)
# make container  a fresh wheel, the Containerfile carried out in a chroot of Debian, a photo annotated there; root, minutes
# make licences  docs/licences.md, and the same as SPDX in dist/; installs every extra to read their licences
# make fuzz  200,000 damaged files of each family into their readers: hours, for a nightly run
# The first two work from a bare checkout with nothing but Python 3.11-3.13, make and apt.

PYTHON ?= python3
VENV   ?= .venv
BIN    := $(VENV)/bin
EVERY  := browser,coco,delf,demo,detectors,docs,index,jupyter,parquet,postgres,ray,release,replace,report,review,rfdetr,test,train,usd,xfeat
APT    := $(shell [ "$$(id -u)" = 0 ] || echo sudo) apt-get

.PHONY: demo test test-fast lint models blender postgres browser ray detectors web web-packages docs wheel container licences fuzz clean

demo: $(VENV)/.demo models
	$(BIN)/cadpose library add sweethome3d
	$(BIN)/python scripts/demo_photos.py runs/demo/photos
	$(BIN)/cadpose annotate runs/demo/photos --out runs/demo
	@echo; echo "Pictures: open runs/demo/index.html, or look at runs/demo/*.overlay.png"

test: $(VENV)/.test models lint
	$(BIN)/python -m pytest -n 2

test-fast: $(VENV)/.test
	$(BIN)/python -m pytest -n 2 -m "not slow"

lint: $(VENV)/.test
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/lint-imports --no-logo
	$(BIN)/mypy

# The Debian package with 820 CC-licensed CAD models (120 MB).
models:
	@[ -d /usr/share/sweethome3d/furniture ] \
		|| { $(APT) update -q && $(APT) install -qy --no-install-recommends sweethome3d-furniture; }

blender: $(VENV)/.test
	$(APT) update -q && $(APT) install -qy --no-install-recommends libx11-6 libgl1 libsm6 libxext6 libxfixes3 \
		libxi6 libxrender1 libxkbcommon0
	$(BIN)/cadpose blender setup

# The tests start a server of their own in a temporary folder; the one that Debian may start is left alone.
postgres:
	@ls /usr/lib/postgresql/*/bin/initdb >/dev/null 2>&1 \
		|| { $(APT) update -q && $(APT) install -qy --no-install-recommends postgresql; }

# npm unpacks here and runs nothing: three packages of plain scripts, by version.
browser: $(VENV)/.test
	@command -v chromium >/dev/null \
		|| { $(APT) update -q && $(APT) install -qy --no-install-recommends chromium; }
	@command -v npm >/dev/null || { $(APT) update -q && $(APT) install -qy --no-install-recommends nodejs npm; }
	$(BIN)/python -m pip install -q -e '.[browser]'
	rm -rf $(VENV)/browser && mkdir -p $(VENV)/browser
	cd $(VENV)/browser && npm pack --silent three@0.187.0 gltf-validator@2.0.0-dev.3.10 axe-core@4.14.1 \
		&& for name in three gltf-validator axe-core; do \
			mkdir $$name && tar -xzf $$name-[0-9]*.tgz -C $$name --strip-components 1 || exit 1; done

web: web-packages
	cd web && npm run check && npm test && npm run build

web-packages: web/node_modules/.package-lock.json

web/node_modules/.package-lock.json: web/package-lock.json
	@command -v npm >/dev/null || { $(APT) update -q && $(APT) install -qy --no-install-recommends nodejs npm; }
	cd web && npm ci --ignore-scripts
	@touch $@

ray: $(VENV)/.test
	$(BIN)/python -m pip install -q -e '.[ray]'

docs: $(VENV)/.docs
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --quiet --strict
	@echo "The site: open runs/site/index.html"

wheel: $(VENV)/.test
	$(BIN)/python scripts/check_wheel.py --tried runs/wheel-tried

container: $(VENV)/.test
	@command -v debootstrap >/dev/null \
		|| { $(APT) update -q && $(APT) install -qy --no-install-recommends debootstrap; }
	$(BIN)/python scripts/check_wheel.py --no-trials
	CADPOSE_CONTAINER=1 $(BIN)/python -m pytest tests/release/test_container.py

licences: $(VENV)/.test
	$(BIN)/python -m pip install -q -e '.[$(EVERY)]'
	$(BIN)/python scripts/licence_inventory.py

fuzz: $(VENV)/.test
	$(BIN)/python -m tests.fuzzing --inputs 200000 --kept runs/fuzz

detectors: $(VENV)/.test
	$(BIN)/python -m pip install -q -e '.[detectors]'
	$(BIN)/cadpose detectors setup

# Debian's python3 comes without venv; ask apt for it only where it is missing.
$(BIN)/python:
	@$(PYTHON) -c 'import ensurepip, venv' 2>/dev/null \
		|| { $(APT) update -q && $(APT) install -qy --no-install-recommends python3-venv; }
	$(PYTHON) -m venv $(VENV)

$(VENV)/.demo: pyproject.toml | $(BIN)/python
	$(BIN)/python -m pip install -q -e '.[demo]'
	@touch $@

$(VENV)/.test: pyproject.toml | $(BIN)/python
	$(BIN)/python -m pip install -q -e '.[test,demo,train,release]'
	@touch $@ $(VENV)/.demo

# Beside the tests' extras, so that neither target takes away what the other one put there.
$(VENV)/.docs: pyproject.toml | $(BIN)/python
	$(BIN)/python -m pip install -q -e '.[docs]'
	@touch $@

clean:
	rm -rf $(VENV) web/node_modules runs dist .mypy_cache .ruff_cache .pytest_cache .hypothesis .import_linter_cache
